use super::*;
use crate::Layout;
use proptest::prelude::*;

fn point() -> impl Strategy<Value = [f32; 3]> {
    prop::array::uniform3(prop_oneof![
        -1.0f32..1.0,
        (-2i8..=2).prop_map(|c| f32::from(c) / 2.0)
    ])
}

/// Turns, scales (unevenly too), shears, mirrors and moves, near and far.
fn transform() -> impl Strategy<Value = Transform> {
    let linear = prop::array::uniform3(prop::array::uniform3(prop_oneof![
        -2.0f64..2.0,
        Just(0.0),
        Just(1.0),
        -100.0f64..100.0
    ]));
    let far = prop_oneof![Just(1.0), Just(1e3), Just(1e-3), Just(1e6)];
    (linear, prop::array::uniform3(-2.0f64..2.0), far)
        .prop_map(|(m, t, far)| std::array::from_fn(|i| [m[i][0], m[i][1], m[i][2], t[i] * far]))
        .prop_filter_map("it has an inverse", |rows| Transform::from_rows(rows).ok())
}

/// Every instance asked.
fn ask_all(instances: &Instances, ray: &Ray) -> Vec<InstanceHit> {
    let mut all = Vec::new();
    for instance in 0..instances.len() as u32 {
        let mut hits = Vec::new();
        let tree = instances.tree(instance);
        tree.all_hits(&instances.local_ray(instance, ray), &mut hits, &mut ());
        all.extend(hits.into_iter().map(|hit| InstanceHit { hit, instance }));
    }
    all.sort_by(|a, b| {
        let key = |found: &InstanceHit| (found.hit.t, found.instance, found.hit.triangle);
        key(a).partial_cmp(&key(b)).unwrap()
    });
    all
}

proptest! {
    #![proptest_config(crate::testing::cases(400))]

    #[test]
    fn instances_are_hit_as_asking_each_of_them_says(
        corners in prop::collection::vec(prop::array::uniform3(point()), 1..12),
        transforms in prop::collection::vec(transform(), 1..12),
        rays in prop::collection::vec((point(), point(), 0usize..12), 30),
        origin_scale in prop_oneof![Just(1.0f32), Just(3.0), Just(1e6)],
    ) {
        let positions: Vec<_> = corners.iter().flatten().copied().collect();
        let triangles = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh::new(positions, triangles).unwrap();
        let tree = Arc::new(Tree::new(&mesh).unwrap());
        let wide = Arc::new((*tree).clone().with_layout(Layout::Wide).unwrap());
        // Each twice, for ties.
        let twice = [&tree, &wide].into_iter().flat_map(|tree| transforms.iter().map(|&t| (tree.clone(), t)));
        let instances = Instances::new(twice).unwrap();
        let mut hits = Vec::new();
        for (origin, target, at) in rays {
            // Towards an instance, so that many are hit.
            let target = transforms[at % transforms.len()].point(target.map(f64::from));
            let origin = origin.map(|c| c * origin_scale);
            let ray = Ray::new(origin, std::array::from_fn(|i| target[i] as f32 - origin[i]));
            let all = ask_all(&instances, &ray);
            prop_assert_eq!(instances.closest_hit(&ray, &mut ()), all.first().copied());
            prop_assert_eq!(instances.any_hit(&ray, &mut ()), !all.is_empty());
            instances.all_hits(&ray, &mut hits, &mut ());
            prop_assert_eq!(&hits, &all);
            let late = |found: &InstanceHit| found.instance as usize >= transforms.len();
            let first = all.iter().copied().find(late);
            prop_assert_eq!(instances.closest_hit_where(&ray, late, &mut ()), first);
            prop_assert_eq!(instances.any_hit_where(&ray, late, &mut ()), first.is_some());
        }
    }
}

#[test]
fn a_ray_visits_few_of_many_instances() {
    let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = Mesh::new(positions, vec![[0, 1, 2]]).unwrap();
    let tree = Arc::new(Tree::new(&mesh).unwrap());
    let at = |i: u32| Transform::translation([f64::from(i % 100), f64::from(i / 100), 0.0]);
    let instances = Instances::new((0..10_000).map(|i| (tree.clone(), at(i)))).unwrap();
    let mut counts = crate::Counts::default();
    let ray = Ray::new([57.25, 31.25, 1.0], [0.0, 0.0, -1.0]);
    let found = instances.closest_hit(&ray, &mut counts).unwrap();
    assert_eq!(found.instance, 3157);
    assert_eq!(instances.normal(&found), [0.0, 0.0, 1.0]);
    assert!(
        counts.triangle_tests < 5 && counts.kd_visits < 60,
        "{counts:?}"
    );
}

#[test]
fn instances_of_nothing_and_no_instances_are_missed() {
    let empty = Arc::new(Tree::new(&Mesh::new(vec![], vec![]).unwrap()).unwrap());
    let ray = Ray::new([0.0; 3], [0.0, 0.0, 1.0]);
    for count in [0, 3] {
        let instances =
            Instances::new((0..count).map(|_| (empty.clone(), Transform::IDENTITY))).unwrap();
        assert_eq!(instances.len(), count);
        assert_eq!(instances.closest_hit(&ray, &mut ()), None);
    }
}

#[test]
fn an_instance_out_of_reach_is_named() {
    let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let tree = Tree::new(&Mesh::new(positions, vec![[0, 1, 2]]).unwrap()).unwrap();
    let far = Transform::translation([0.0, 1e19, 0.0]);
    let tree = Arc::new(tree);
    let error = Instances::new([(tree.clone(), Transform::IDENTITY), (tree, far)]).unwrap_err();
    assert_eq!(error, InstancesError::OutOfReach { instance: 1 });
}
