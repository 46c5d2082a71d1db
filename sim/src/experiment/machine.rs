//! What an experiment ran on.

use std::collections::HashSet;
use std::{fmt, fs};

use crate::pool::cores;
use crate::simd::Simd;

/// The machine and the build.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Machine {
    /// The processor's name.
    pub processor: String,
    /// The hardware threads that this process may use, a worker each.
    pub threads: usize,
    /// The cores that these are of, where the system says: two hardware threads of one core get less done than two cores.
    pub cores: Option<usize>,
    /// The operating system.
    pub system: &'static str,
    /// The instruction set that the program was built for.
    pub architecture: &'static str,
    /// The vector instructions that the kernels use.
    pub instructions: &'static str,
}

impl Machine {
    /// This machine.
    #[must_use]
    pub fn this() -> Self {
        let threads = cores();
        Self {
            processor: processor().unwrap_or_else(|| "unknown processor".to_owned()),
            threads,
            cores: physical_cores(threads),
            system: std::env::consts::OS,
            architecture: std::env::consts::ARCH,
            instructions: Simd::detect().instructions().name(),
        }
    }

    /// Whether two threads can have a core each, as far as is known. Where they cannot, they never gain
    /// [`Phase::LEAST_GAIN`](super::calibrator::Phase::LEAST_GAIN), and every round is marked.
    #[must_use]
    pub fn has_two_cores(&self) -> bool {
        self.cores.unwrap_or(self.threads) > 1
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { processor, threads, cores, system, architecture, instructions } = self;
        let plural = |count: usize| if count == 1 { "" } else { "s" };
        write!(f, "{processor}, ")?;
        match *cores {
            Some(cores) if cores == *threads => write!(f, "{cores} core{}", plural(cores))?,
            Some(cores) => {
                let plurals = [plural(*threads), plural(cores)];
                write!(f, "{threads} hardware thread{} of {cores} core{}", plurals[0], plurals[1])?;
            }
            None => write!(f, "{threads} hardware thread{}", plural(*threads))?,
        }
        write!(f, ", {system} {architecture}, kernels {instructions}")?;
        if !self.has_two_cores() {
            write!(f, "; without two whole cores every round is marked")?;
        }
        Ok(())
    }
}

/// How many cores so many hardware threads are of, as Linux tells: those that name different siblings. Other systems
/// are not asked. Where more of them may be used, but for a share of the time only, as in a container, nobody can say
/// which.
fn physical_cores(threads: usize) -> Option<usize> {
    let usable = core_affinity::get_core_ids().filter(|usable| usable.len() == threads)?;
    let siblings = usable.into_iter().map(|thread| {
        let list =
            format!("/sys/devices/system/cpu/cpu{}/topology/thread_siblings_list", thread.id);
        fs::read_to_string(list).ok()
    });
    let cores: Option<HashSet<String>> = siblings.collect();
    cores.map(|cores| cores.len())
}

/// What Linux says of the processor; other systems are not asked.
fn processor() -> Option<String> {
    let text = fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    let (_, name) = line.split_once(':')?;
    Some(name.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_a_core() {
        let machine = Machine::this();
        assert!(machine.threads >= 1 && machine.cores != Some(0));
        assert!(machine.to_string().contains(machine.architecture));
    }

    #[test]
    fn fewer_hardware_threads_than_there_are_say_nothing_of_cores() {
        let threads = core_affinity::get_core_ids().map_or(0, |usable| usable.len());
        assert_eq!(physical_cores(threads + 1), None);
        assert!(physical_cores(threads).is_none_or(|cores| (1..=threads).contains(&cores)));
    }

    #[test]
    fn cores_and_hardware_threads_are_told_apart() {
        let told = |threads, cores| Machine { threads, cores, ..Machine::this() }.to_string();
        for (threads, cores, expected, is_enough) in [
            (1, Some(1), " 1 core, ", false),
            (2, Some(1), " 2 hardware threads of 1 core, ", false),
            (8, Some(8), " 8 cores, ", true),
            (8, Some(4), " 8 hardware threads of 4 cores, ", true),
            (1, None, " 1 hardware thread, ", false),
            (2, None, " 2 hardware threads, ", true),
        ] {
            let told = told(threads, cores);
            assert!(told.contains(expected), "{expected}");
            assert_eq!(told.ends_with("every round is marked"), !is_enough, "{told}");
        }
    }
}
