//! Conversions that features bring.

use splitplane::{ClosestPoint, Hit, Mesh, Ray, Transform, TransformError, Tree, TreeChoice};

fn again<T: serde::Serialize + for<'a> serde::Deserialize<'a>>(value: &T) -> T {
    serde_json::from_str(&serde_json::to_string(value).unwrap()).unwrap()
}

#[test]
fn what_is_written_is_read_again() {
    let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.1]];
    let tree = Tree::new(&Mesh::new(positions, vec![[0, 1, 2]]).unwrap()).unwrap();
    let ray = Ray {
        t_max: 7.0,
        ..Ray::new([0.1, 0.3, 1.0], [0.0, 0.0, -1.0])
    };
    assert_eq!(again(&ray), ray);
    let hit: Hit = tree.closest_hit(&ray, &mut ()).unwrap();
    assert_eq!(again(&hit), hit);
    let near: ClosestPoint = tree.closest_point([0.5; 3], 9.0, &mut ()).unwrap();
    assert_eq!(again(&near), near);
    assert_eq!(again(&tree.bounds()), tree.bounds());
    assert_eq!(again(&tree.choice()), tree.choice());
    assert!(serde_json::from_str::<TreeChoice>("\"oak\"").is_err());
    let moved = Transform::translation([1.0, 2.0, 3.0]);
    assert_eq!(again(&moved), moved);
    let flat = "[[0,0,0,0],[0,0,0,0],[0,0,0,0]]";
    let error = serde_json::from_str::<Transform>(flat).unwrap_err();
    assert!(error.to_string().contains("cannot be inverted"), "{error}");
}

#[test]
fn transforms_of_other_libraries_are_the_same_transforms() {
    let rows = [
        [0.0, -2.0, 0.0, 3.0],
        [1.0, 0.5, 0.0, -1.0],
        [0.0, 0.0, 4.0, 0.5],
    ];
    let ours = Transform::from_rows(rows).unwrap();
    let theirs = mint::RowMatrix3x4::from(rows);
    assert_eq!(Transform::try_from(theirs), Ok(ours));
    let column = |j: usize| glam::DVec3::new(rows[0][j], rows[1][j], rows[2][j]);
    let affine = glam::DAffine3 {
        matrix3: glam::DMat3::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    };
    assert_eq!(Transform::try_from(affine), Ok(ours));
    assert_eq!(Transform::try_from(affine.as_affine3a()), Ok(ours));
    let flat = glam::DAffine3::ZERO;
    assert_eq!(Transform::try_from(flat), Err(TransformError::Singular));
}
