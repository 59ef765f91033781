//! What each thread did during builds, and when: for the viewers of Chrome's trace events.

use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use serde_json::{Value, json};
use splitplane::BuildPart;

/// Collects what builds tell of their parts.
pub struct Timeline {
    start: Instant,
    events: Mutex<Vec<Value>>,
}

/// One build on a timeline: watches it, and passes on what is told.
pub struct TimedBuild<'a> {
    timeline: &'a Timeline,
    progress: &'a dyn splitplane::Progress,
    build: usize,
}

impl Default for Timeline {
    fn default() -> Self {
        Timeline {
            start: Instant::now(),
            events: Mutex::default(),
        }
    }
}

impl Timeline {
    /// The next build, by the number of the build and what to call it: to be watched by what is
    /// given back.
    pub fn build<'a>(
        &'a self,
        build: usize,
        name: &str,
        progress: &'a dyn splitplane::Progress,
    ) -> TimedBuild<'a> {
        self.push(json!({
            "name": "process_name", "ph": "M", "pid": build, "tid": 0, "args": { "name": name },
        }));
        TimedBuild {
            timeline: self,
            progress,
            build,
        }
    }

    /// All that was told, as a file in the Trace Event Format (JSON): a process for each build, a
    /// thread for each of its threads, microseconds. Perfetto and `chrome://tracing` show it.
    pub fn to_json(&self) -> Value {
        let events = self.events.lock().unwrap_or_else(PoisonError::into_inner);
        json!({ "traceEvents": *events, "displayTimeUnit": "ms" })
    }

    fn push(&self, event: Value) {
        self.events
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(event);
    }
}

impl TimedBuild<'_> {
    fn event(&self, phase: &str) -> Value {
        json!({
            "ph": phase,
            "ts": self.timeline.start.elapsed().as_secs_f64() * 1e6,
            "pid": self.build,
            "tid": rayon::current_thread_index().unwrap_or_default(),
        })
    }
}

impl splitplane::Progress for TimedBuild<'_> {
    fn advanced(&self, done: u64, total: u64) {
        self.progress.advanced(done, total);
    }

    fn cancelled(&self) -> bool {
        self.progress.cancelled()
    }

    fn began(&self, part: BuildPart, triangles: usize) {
        let mut event = self.event("B");
        event["name"] = part.name().into();
        event["args"] = json!({ "triangles": triangles });
        self.timeline.push(event);
    }

    fn ended(&self) {
        self.timeline.push(self.event("E"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Preset, Settings, build};
    use splitplane::{Mesh, TREES, TreeChoice};

    /// As many separate triangles in a row.
    fn row(count: u32) -> Mesh {
        let positions = (0..count)
            .flat_map(|i| {
                let x = i as f32;
                [[x, 0.0, 0.0], [x + 0.5, 1.0, 0.0], [x, 0.0, 1.0]]
            })
            .collect();
        let triangles = (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        Mesh::new(positions, triangles).unwrap()
    }

    #[test]
    fn on_each_thread_what_begins_ends_and_parts_lie_within_each_other() {
        let mesh = row(20_000);
        let timeline = Timeline::default();
        let mut settings = Settings::of_preset(Preset::Default);
        settings.render.threads = 2;
        for (i, name) in ["kd", "wn+kd:6", "bvh"].into_iter().enumerate() {
            let choice: TreeChoice = name.parse().unwrap();
            assert!(TREES.iter().any(|spec| spec.name == choice.spec.name));
            build(&mesh, choice, &settings, &timeline.build(i, name, &())).unwrap();
        }
        let json = timeline.to_json();
        let events = json["traceEvents"].as_array().unwrap();
        for build in 0..3 {
            let mut seen = std::collections::BTreeSet::new();
            for thread in 0..2 {
                let own = events
                    .iter()
                    .filter(|e| e["pid"] == build && e["tid"] == thread && e["ph"] != "M");
                let (mut open, mut last) = (Vec::new(), 0.0);
                for event in own {
                    let at = event["ts"].as_f64().unwrap();
                    assert!(at >= last);
                    last = at;
                    match event["ph"].as_str().unwrap() {
                        "B" => {
                            let triangles = event["args"]["triangles"].as_u64().unwrap();
                            assert!(triangles >= 4096);
                            seen.insert(event["name"].as_str().unwrap());
                            open.push(triangles);
                        }
                        "E" => assert!(open.pop().is_some()),
                        other => panic!("{other}"),
                    }
                }
                assert!(open.is_empty());
            }
            assert!(
                seen.contains("subtree") && seen.contains("search"),
                "{seen:?}"
            );
        }
    }
}
