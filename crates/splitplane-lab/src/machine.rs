//! What is known of the machine that measures.

use serde::{Deserialize, Serialize};
use sysinfo::{CpuRefreshKind, RefreshKind, System};

/// The machine, and how busy it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// The processor, by its maker's name; "unknown" where the system does not say.
    pub cpu: String,
    /// Logical processors that this process may use.
    pub cores: usize,
    /// Processes that ran or waited, averaged over the last minute; `None` where the system does
    /// not say.
    pub load_1m: Option<f64>,
    /// The operating system and its version.
    pub os: String,
}

impl Machine {
    /// This machine, now.
    pub fn now() -> Machine {
        let unknown = || "unknown".to_owned();
        let cpu =
            System::new_with_specifics(RefreshKind::nothing().with_cpu(CpuRefreshKind::nothing()))
                .ok()
                .and_then(|system| Some(system.cpus().first()?.brand().trim().to_owned()))
                .filter(|brand| !brand.is_empty());
        Machine {
            cpu: cpu.unwrap_or_else(unknown),
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            load_1m: System::load_average().ok().map(|load| load.one),
            os: System::long_os_version().unwrap_or_else(|_| unknown()),
        }
    }

    /// Whether the machine was so busy before the measurement that times on it may mean little: more
    /// than a quarter of its processors were in use, by whomever. [`crate::Record::was_disturbed`]
    /// knows better where the system tells.
    pub fn is_busy(&self) -> bool {
        self.load_1m
            .is_some_and(|load| load > 0.25 * self.cores as f64)
    }
}

/// Measures how busy others keep the machine while something is timed.
#[derive(Clone, Copy, Debug)]
pub struct OthersLoad {
    start: Option<Ticks>,
}

/// Processor time since the system began, in the system's ticks.
#[derive(Clone, Copy, Debug)]
struct Ticks {
    /// All processors together, idle or not.
    all: u64,
    /// All processors together, at work: for anybody, or for another machine on the same hardware.
    busy: u64,
    /// For this process.
    own: u64,
    /// How many processors there are; this process may be confined to fewer.
    processors: usize,
}

impl OthersLoad {
    /// Begins.
    pub fn start() -> OthersLoad {
        OthersLoad {
            start: Ticks::now(),
        }
    }

    /// Processors that other processes kept busy since the start, on average; `None` where the
    /// system does not say (it does on Linux), or where the time was too short to tell.
    pub fn stop(self) -> Option<f64> {
        Ticks::now()?.others_since(self.start?)
    }
}

impl Ticks {
    /// Processors that others kept busy since `start`.
    fn others_since(self, start: Ticks) -> Option<f64> {
        let each = self.all.saturating_sub(start.all) as f64 / self.processors as f64;
        // Each of the three may be off by a tick a processor.
        if each < 20.0 {
            return None;
        }
        let own = self.own.saturating_sub(start.own);
        let others = self.busy.saturating_sub(start.busy).saturating_sub(own);
        Some(others as f64 / each)
    }

    fn now() -> Option<Ticks> {
        let system = std::fs::read_to_string("/proc/stat").ok()?;
        let fields: Vec<u64> = (system.lines().next()?.split_whitespace().skip(1))
            .map_while(|field| field.parse().ok())
            .collect();
        // user nice system idle iowait irq softirq steal; guests are part of user.
        let all: u64 = fields.get(..8)?.iter().sum();
        let own = std::fs::read_to_string("/proc/self/stat").ok()?;
        // The name of the process may hold anything but ends with the last bracket.
        let own: Vec<&str> = own.rsplit(')').next()?.split_whitespace().collect();
        let ticks = |i: usize| own.get(i)?.parse::<u64>().ok();
        Some(Ticks {
            all,
            busy: all - fields[3] - fields[4],
            own: ticks(11)? + ticks(12)?,
            processors: (system.lines().skip(1))
                .filter(|line| line.starts_with("cpu"))
                .count()
                .max(1),
        })
    }
}

/// The most memory that this process has held so far, in bytes; `None` where the system does not
/// say (it does on Linux).
pub fn peak_memory_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

/// From now on, [`peak_memory_bytes`] is about what is held from now on; `false` where the system
/// cannot do that (Linux can).
pub fn forget_peak_memory() -> bool {
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_has_a_core_and_a_name_for_everything() {
        let machine = Machine::now();
        assert!(machine.cores >= 1);
        assert!(!machine.cpu.is_empty() && !machine.os.is_empty());
    }

    #[test]
    fn the_load_of_others_is_what_is_busy_and_not_ones_own() {
        let start = Ticks {
            all: 1000,
            busy: 500,
            own: 70,
            processors: 2,
        };
        // A second of two processors: one of them busy with this process, the other half of it.
        let end = Ticks {
            all: 1200,
            busy: 650,
            own: 170,
            processors: 2,
        };
        assert_eq!(end.others_since(start), Some(0.5));
        let alone = Ticks { busy: 600, ..end };
        assert_eq!(alone.others_since(start), Some(0.0));
        let soon = Ticks { all: 1030, ..end };
        assert_eq!(soon.others_since(start), None);
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn another_process_at_work_is_seen() {
        use std::time::Duration;
        let over = |work: &mut dyn FnMut()| {
            let load = OthersLoad::start();
            work();
            load.stop().expect("half a second is enough to tell")
        };
        let mut other = std::process::Command::new("sh")
            .args(["-c", "while :; do :; done"])
            .spawn()
            .unwrap();
        let disturbed = over(&mut || std::thread::sleep(Duration::from_millis(600)));
        other.kill().unwrap();
        other.wait().unwrap();
        assert!(disturbed > 0.3, "{disturbed}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_peak_of_memory_is_more_than_a_large_allocation() {
        let block = std::hint::black_box(vec![1_u8; 64 << 20]);
        assert!(peak_memory_bytes().unwrap() > block.len() as u64);
    }
}
