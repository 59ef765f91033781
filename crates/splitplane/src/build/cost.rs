//! What a split costs, and whether it is worth it.

use super::params::{BuildParams, ObliquePricing};
use super::search::Best;
use crate::catalog::TreeSpec;

/// The best candidates of a node, by the kind of node that they would make.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Contest<P> {
    axis: Option<(P, Best)>,
    oblique: Option<(P, Best)>,
}

/// A split, and whether it beats a leaf.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Choice<P> {
    pub(crate) candidate: P,
    /// The areas of the cells below and above, as fractions of the node's.
    pub(crate) areas: (f64, f64),
    /// The split does not beat a leaf.
    pub(crate) bad_refine: bool,
    /// The split is so much worse than a leaf that a small node is better left alone.
    pub(crate) hopeless: bool,
}

impl<P: Copy> Contest<P> {
    pub(crate) fn new() -> Self {
        Contest {
            axis: None,
            oblique: None,
        }
    }

    /// Enters a candidate. The first of equals stays.
    pub(crate) fn enter(&mut self, plane: P, is_axis: bool, best: Best) {
        let slot = if is_axis {
            &mut self.axis
        } else {
            &mut self.oblique
        };
        if slot.is_none_or(|(_, other)| best.expected_tests < other.expected_tests) {
            *slot = Some((plane, best));
        }
    }

    /// Only a candidate of fewer expected tests than this can change what is decided.
    pub(crate) fn bar(
        &self,
        is_axis: bool,
        spec: &TreeSpec,
        params: &BuildParams,
        n: usize,
    ) -> f64 {
        let tests = |slot: &Option<(P, Best)>| match slot {
            Some((_, best)) => best.expected_tests,
            None => f64::INFINITY,
        };
        if is_axis {
            return tests(&self.axis);
        }
        let (axis, oblique) = (tests(&self.axis), tests(&self.oblique));
        if !spec.axis_nodes {
            return oblique.min(axis);
        }
        let axis_cost = params.kd_traversal_cost + params.intersection_cost * axis;
        let leaf_cost = params.intersection_cost * n as f64;
        let may_be_left_alone = is_hopeless(axis_cost, leaf_cost, n);
        if axis == f64::INFINITY || may_be_left_alone || params.intersection_cost == 0.0 {
            return oblique;
        }
        // At the linear price an oblique plane must beat the best axis. Where that one does not
        // beat a leaf, an oblique plane may, at the constant price.
        let linear = linear_cost(params, n);
        let rounding = 1e-12 * (axis_cost + linear + params.oblique_traversal_cost);
        let mut most = axis_cost - linear;
        if axis_cost >= leaf_cost {
            most = most.max(leaf_cost - params.oblique_traversal_cost);
        }
        oblique.min((most + rounding) / params.intersection_cost)
    }

    /// The split to make in a node of `n` triangles, priced as the tree prices; `None` where there
    /// is no candidate.
    pub(crate) fn decide(
        &self,
        spec: &TreeSpec,
        params: &BuildParams,
        n: usize,
    ) -> Option<Choice<P>> {
        let leaf_cost = params.intersection_cost * n as f64;
        let priced = |candidate: Option<(P, Best)>, traversal_cost: f64| {
            candidate.map(|(plane, best)| {
                let cost = traversal_cost + params.intersection_cost * best.expected_tests;
                (cost, plane, best)
            })
        };
        // Of equals the first: axes come before other directions.
        let cheaper = |a: Option<(f64, P, Best)>, b: Option<(f64, P, Best)>| match (a, b) {
            (Some(a), Some(b)) if b.0 < a.0 => Some(b),
            (a, b) => a.or(b),
        };
        let choice = |(_, plane, best): (f64, P, Best), lowest_cost: f64| Choice {
            candidate: plane,
            areas: best.areas,
            bad_refine: lowest_cost > leaf_cost,
            hopeless: is_hopeless(lowest_cost, leaf_cost, n),
        };
        if !spec.axis_nodes {
            let constant = params.oblique_traversal_cost;
            let first = cheaper(priced(self.axis, constant), priced(self.oblique, constant))?;
            return Some(choice(first, first.0));
        }
        let linear = linear_cost(params, n);
        let first = cheaper(
            priced(self.axis, params.kd_traversal_cost),
            priced(self.oblique, linear),
        )?;
        let second = priced(self.oblique, params.oblique_traversal_cost);
        let lowest_cost = second.map_or(first.0, |second| second.0.min(first.0));
        let taken = match (params.oblique_pricing, second) {
            (ObliquePricing::Published { .. }, Some(second))
                if first.0 >= leaf_cost && second.0 < leaf_cost =>
            {
                second
            }
            _ => first,
        };
        Some(choice(taken, lowest_cost))
    }
}

/// A split of this cost is so much worse than a leaf that a small node is better left alone.
fn is_hopeless(cost: f64, leaf_cost: f64, n: usize) -> bool {
    cost > 4.0 * leaf_cost && n < 16
}

/// What a visit of an oblique node of `n` triangles costs where it competes with kd nodes.
fn linear_cost(params: &BuildParams, n: usize) -> f64 {
    let (ObliquePricing::Published { alpha } | ObliquePricing::Fork { alpha }) =
        params.oblique_pricing;
    alpha * params.intersection_cost * (n as f64 - 1.0) + params.kd_traversal_cost
}
