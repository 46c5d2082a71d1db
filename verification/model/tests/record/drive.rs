//! Runs a virtual environment on threads: workers sleep when they find nothing, leave and join while
//! frames run, and hand tokens on. Each test binary says what threads these are by `os`.

use dualframe_protocol::trace::{Event, Seen};

use crate::dut::pipeline::Pipeline;
use crate::dut::token::Token;
use crate::dut::wait::{Bell, Epoch, Waiting};
use crate::dut::worker::Step;
use crate::os::{self, Condvar, Mutex};

use super::{Host, Recorder, Renderer, Screen, Setup, Slots};

/// Sleeps on condition variables, for as long as it takes: a wake-up that is lost is a hang.
#[derive(Default)]
pub(crate) struct Park([(Mutex<()>, Condvar); 2]);

impl Waiting for Park {
    fn sleep(&self, bell: &Bell, seen: Epoch) {
        let (room, awake) = &self.0[usize::from(bell.is_for_holders())];
        let mut guard = room.lock().expect("no poison");
        while !bell.rung_since(seen) {
            guard = awake.wait(guard).expect("no poison");
        }
    }

    fn wake(&self, bell: &Bell, count: u32) {
        let (room, awake) = &self.0[usize::from(bell.is_for_holders())];
        drop(room.lock().expect("no poison"));
        (0..count.min(64)).for_each(|_| awake.notify_one());
    }
}

type Machine<'a, W> = Pipeline<'a, Host<'a>, W>;
/// Tokens that no worker holds.
type Shop<'p> = Mutex<Vec<Token<'p, Screen>>>;

/// Runs `setup` with `workers` workers and returns what was seen, and the units' values.
pub(crate) fn run<W: Waiting>(setup: &Setup, workers: u32, waiting: W) -> (Vec<Seen>, Vec<u32>) {
    let recorder = Recorder::default();
    let mut slots = Slots::new(setup);
    let mut pipeline = slots.pipeline(setup, waiting);
    let tokens = match setup.renderer {
        Renderer::Tokens(tokens) => tokens,
        Renderer::Shared => {
            pipeline.share(Screen).map_err(drop).expect("no token is out");
            0
        }
    };
    let token = |_| pipeline.token(Screen).map_err(drop).expect("a token");
    let shop: Shop<'_> = Mutex::new((0..tokens).map(token).collect());
    os::scope(|scope| {
        for worker in 0..workers {
            let host = Host { setup, recorder: &recorder, worker, pause: os::let_others_run };
            let (pipeline, shop) = (&pipeline, &shop);
            scope.spawn(move || {
                let _alarm = os::alarm();
                work(pipeline, shop, host);
            });
        }
    });
    drop(shop);
    assert_eq!(pipeline.take_back().is_some(), setup.renderer == Renderer::Shared);
    let values = pipeline.objects_mut().map(|body| body.value).collect();
    drop(pipeline);
    (recorder.into_record(), values)
}

/// One thread, from joining to leaving for good. The first one stays to the end.
fn work<'p, 'a: 'p, W: Waiting>(pipeline: &'p Machine<'a, W>, shop: &Shop<'p>, mut host: Host<'a>) {
    while !pipeline.finished() {
        let stays = host.worker == 0 || os::below(3) == 0;
        stint(pipeline, shop, &mut host, stays);
        if !stays && os::below(2) == 0 {
            return;
        }
    }
}

/// From joining to leaving: often when it has just been woken, and is counted on. Whoever holds a
/// token, or sees one lie about, stays meanwhile.
fn stint<'p, 'a: 'p, W: Waiting>(
    pipeline: &'p Machine<'a, W>,
    shop: &Shop<'p>,
    host: &mut Host<'a>,
    stays: bool,
) {
    let (env, see) = (*host, |event| host.recorder.see(host.worker, event));
    see(Event::Join);
    let mut worker = pipeline.worker_at(host.worker).probed(env);
    let (mut holds, mut tired) = (false, false);
    while !pipeline.finished() && (stays || !tired || holds || !is_empty(shop)) {
        if worker.step(&env).expect("memory for all") != Step::Idle {
            tired = os::below(32) == 0;
            if holds && os::below(24) == 0 {
                see(Event::Release);
                shop.lock().expect("no poison").extend(worker.release());
                holds = false;
            }
            continue;
        }
        // Whoever lays the token down is awake until someone has taken it.
        let offered = if holds { None } else { shop.lock().expect("no poison").pop() };
        if let Some(token) = offered {
            worker.hold(token).map_err(drop).expect("this pipeline's token");
            see(Event::Hold);
            holds = true;
        } else {
            worker.wait();
            tired = os::below(3) == 0;
        }
    }
    // Ahead of it: others may take what this worker leaves before they see that it has left.
    see(Event::Leave);
    drop(worker);
}

fn is_empty(shop: &Shop<'_>) -> bool {
    shop.lock().expect("no poison").is_empty()
}
