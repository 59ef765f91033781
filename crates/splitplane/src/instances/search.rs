//! Searches of the upper level: a "triangle" of its tree is an instance.

use std::cell::RefCell;
use std::ops::ControlFlow;

use super::{InstanceHit, Placed};
use crate::geometry::Ray;
use crate::query::{Counters, Hit, Search, Triangle};

/// Counts what the upper level does. Both levels count on one thread, but not in one place.
pub(super) struct Upper<'a, 'b, C>(pub(super) &'a RefCell<&'b mut C>);

impl<C: Counters> Counters for Upper<'_, '_, C> {
    #[inline(always)]
    fn kd_visit(&mut self) {
        self.0.borrow_mut().kd_visit();
    }
}

pub(super) struct Closest<'a, 'b, F, C> {
    pub(super) placed: &'a [Placed],
    /// Its `t_max` is that of the best hit.
    pub(super) ray: Ray,
    pub(super) accept: F,
    pub(super) best: Option<InstanceHit>,
    pub(super) counters: &'a RefCell<&'b mut C>,
}

impl<F: Fn(&InstanceHit) -> bool, C: Counters> Search for Closest<'_, '_, F, C> {
    const NEAREST_FIRST: bool = true;

    fn limit(&self) -> f64 {
        f64::from(self.ray.t_max)
    }

    fn test(&mut self, triangle: &impl Triangle) -> ControlFlow<()> {
        let instance = triangle.index();
        let Placed { tree, transform } = &self.placed[instance as usize];
        let accept = |hit: &Hit| {
            let found = InstanceHit {
                hit: *hit,
                instance,
            };
            (self.accept)(&found)
        };
        let ray = transform.local_ray(&self.ray);
        let hit = tree.closest_hit_where(&ray, accept, &mut **self.counters.borrow_mut());
        if let Some(hit) = hit
            && (self.best).is_none_or(|best| hit.t < best.hit.t || instance < best.instance)
        {
            self.ray.t_max = hit.t;
            self.best = Some(InstanceHit { hit, instance });
        }
        ControlFlow::Continue(())
    }
}

pub(super) struct Any<'a, 'b, F, C> {
    pub(super) placed: &'a [Placed],
    pub(super) ray: &'a Ray,
    pub(super) accept: F,
    pub(super) found: bool,
    pub(super) counters: &'a RefCell<&'b mut C>,
}

impl<F: Fn(&InstanceHit) -> bool, C: Counters> Search for Any<'_, '_, F, C> {
    const NEAREST_FIRST: bool = false;

    fn limit(&self) -> f64 {
        f64::from(self.ray.t_max)
    }

    fn test(&mut self, triangle: &impl Triangle) -> ControlFlow<()> {
        let instance = triangle.index();
        let Placed { tree, transform } = &self.placed[instance as usize];
        let accept = |hit: &Hit| {
            let found = InstanceHit {
                hit: *hit,
                instance,
            };
            (self.accept)(&found)
        };
        let ray = transform.local_ray(self.ray);
        self.found = tree.any_hit_where(&ray, accept, &mut **self.counters.borrow_mut());
        if self.found {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

pub(super) struct All<'a, 'b, F, C> {
    pub(super) placed: &'a [Placed],
    pub(super) ray: &'a Ray,
    pub(super) accept: F,
    pub(super) hits: &'a mut Vec<InstanceHit>,
    /// Hits of one instance.
    pub(super) own: Vec<Hit>,
    pub(super) counters: &'a RefCell<&'b mut C>,
}

impl<F: Fn(&InstanceHit) -> bool, C: Counters> Search for All<'_, '_, F, C> {
    const NEAREST_FIRST: bool = false;

    fn limit(&self) -> f64 {
        f64::from(self.ray.t_max)
    }

    fn test(&mut self, triangle: &impl Triangle) -> ControlFlow<()> {
        let instance = triangle.index();
        let Placed { tree, transform } = &self.placed[instance as usize];
        let found = |&hit: &Hit| InstanceHit { hit, instance };
        let accept = |hit: &Hit| (self.accept)(&found(hit));
        let ray = transform.local_ray(self.ray);
        tree.all_hits_where(
            &ray,
            accept,
            &mut self.own,
            &mut **self.counters.borrow_mut(),
        );
        self.hits.extend(self.own.iter().map(found));
        ControlFlow::Continue(())
    }
}
