//! A machine in virtual time: cores with clocks of their own that fetch cache lines from each other. Whichever is behind
//! the others goes on, so that a schedule is what would happen if every access took what is said here.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};

use dut::observer::watch;
use dut::sync::{Access, Site, let_others_run};
use dut::wait::{Bell, Epoch, Waiting};
use shuttle::current::me;
use shuttle::scheduler::{Schedule, Scheduler, Task, TaskId};

use crate::dut;

/// A load of a line that the core has, or any store, for which it does not wait; usually 1 ns.
const HIT: u64 = 1;
/// A read–modify–write in a line that the core has for itself; usually 5 ns.
const EXCHANGE: u64 = 5;
/// A full fence; usually 8 ns.
const FENCE: u64 = 8;
/// From one look of a sleeper at its bell to the next; usually 20 ns.
const PAUSE: u64 = 20;
/// Bytes of a cache line; usually 64.
const LINE: usize = 64;

/// What a worker's time went to in all, in ns.
pub(crate) type Spent = BTreeMap<&'static str, u64>;

/// What a machine is like.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    /// What it takes to fetch a line that another core has written, in ns; usually 40 to 200.
    pub(crate) transfer: u64,
    /// Sites whose accesses take no time.
    pub(crate) free: Vec<Site>,
}

/// Who has a line, one bit for each core, and when it has come to its last writer, who is done with it then.
#[derive(Clone, Copy, Default)]
struct Line {
    holders: u64,
    settled: u64,
}

struct Machine {
    model: Model,
    /// By the numbers of shuttle's tasks, in ns.
    clocks: Vec<u64>,
    /// Who goes on next, and from when on: the one that runs need not ask until then.
    next: (u64, usize),
    lines: HashMap<usize, Line>,
    spent: Spent,
}

thread_local! {
    /// Of the schedule that this thread runs, all of whose tasks are on it.
    static MACHINE: RefCell<Option<Machine>> = const { RefCell::new(None) };
}

fn on_machine<R>(act: impl FnOnce(&mut Machine) -> R) -> R {
    MACHINE.with_borrow_mut(|machine| act(machine.as_mut().expect("a machine that is switched on")))
}

/// Starts a machine of so many cores, and another one for who starts the workers.
pub(crate) fn switch_on(model: Model, cores: usize) {
    let clocks = vec![0; cores + 1];
    let (lines, spent) = (HashMap::new(), Spent::new());
    MACHINE.set(Some(Machine { model, clocks, next: (0, 0), lines, spent }));
    watch(Some(access));
}

/// Ends it, and says what all its workers' time went to since [`forget_spent`].
pub(crate) fn switch_off() -> Spent {
    watch(None);
    MACHINE.take().expect("a machine that is switched on").spent
}

/// Counts what is spent from now on only.
pub(crate) fn forget_spent() {
    on_machine(|machine| machine.spent.clear());
}

/// The number of the core that runs, from 1 on.
pub(crate) fn core() -> usize {
    me().into()
}

/// What this core's clock shows, in ns.
pub(crate) fn now() -> u64 {
    on_machine(|machine| machine.clocks[core()])
}

/// What it takes to fetch a line from another core, in ns.
pub(crate) fn transfer() -> u64 {
    on_machine(|machine| machine.model.transfer)
}

/// This core does something else for so many ns.
pub(crate) fn spend(on: &'static str, time: u64) {
    on_machine(|machine| machine.spend(core(), on, time));
}

/// An access of the core's source.
fn access(site: Site, access: Access, word: usize) {
    let core = core();
    if on_machine(|machine| (machine.clocks[core], core) > machine.next) {
        let_others_run();
    }
    on_machine(|machine| {
        let now = machine.clocks[core];
        let done = machine.access(core, now, access, word / LINE);
        let free = machine.model.free.iter().any(|free| free.name == site.name);
        machine.spend(core, site.name, if free { 0 } else { done - now });
    });
}

impl Machine {
    fn spend(&mut self, core: usize, on: &'static str, time: u64) {
        self.clocks[core] += time;
        *self.spent.entry(on).or_default() += time;
    }

    /// When `core` is done with an access that it begins now.
    fn access(&mut self, core: usize, now: u64, access: Access, line: usize) -> u64 {
        let line = self.lines.entry(line).or_default();
        let bit = 1 << core;
        let has = line.holders & bit != 0;
        let alone = line.holders == bit;
        // Whoever writes keeps the line until that is done; who has stored may still wait for the line to come.
        let settled = now.max(line.settled);
        let fetched = settled + self.model.transfer;
        let own = if alone { settled } else { fetched };
        match access {
            Access::Fence => now + FENCE,
            Access::Load if has => now + HIT,
            Access::Load => {
                line.holders |= bit;
                fetched
            }
            Access::Store => {
                *line = Line { holders: bit, settled: own };
                now + HIT
            }
            Access::Exchange => {
                *line = Line { holders: bit, settled: own + EXCHANGE };
                own + EXCHANGE
            }
        }
    }
}

/// Sleeps by looking at its bell, as workers with a core each do for the time that it takes others to find more work.
pub(crate) struct Looking;

impl Waiting for Looking {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        while !bell.rung_since(seen) {
            spend("asleep", PAUSE);
        }
    }

    fn wake(&self, _: &Bell, _: u32) {}
}

/// Lets whoever is behind go on; of those that are equally far the first.
#[derive(Debug, Default)]
pub(crate) struct Earliest {
    begun: bool,
}

impl Scheduler for Earliest {
    fn new_execution(&mut self) -> Option<Schedule> {
        let first = !std::mem::replace(&mut self.begun, true);
        first.then(|| Schedule::new(0))
    }

    fn next_task(&mut self, tasks: &[&Task], _: Option<TaskId>, _: bool) -> Option<TaskId> {
        MACHINE.with_borrow_mut(|machine| {
            let Some(machine) = machine else { return tasks.first().map(|task| task.id()) };
            let clock = |task: &&Task| {
                let core = usize::from(task.id());
                (machine.clocks[core], core)
            };
            let first = tasks.iter().min_by_key(|task| clock(task))?;
            let others = tasks.iter().filter(|task| task.id() != first.id());
            machine.next = others.map(clock).min().unwrap_or((u64::MAX, usize::MAX));
            Some(first.id())
        })
    }

    fn next_u64(&mut self) -> u64 {
        0
    }
}
