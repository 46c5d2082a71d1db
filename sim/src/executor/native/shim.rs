//! All unsafe code of the native peers: slices shared out to the threads of OpenMP and oneTBB.

#![allow(unsafe_code)]

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{c_int, c_void};
use std::marker::PhantomData;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::ptr::NonNull;
use std::sync::{Mutex, PoisonError};

use super::super::parallel_for::ParallelFor;
use super::super::{ExecutorError, MAX_THREADS};

/// A closure, as C++ hands it back.
type Context = *const c_void;
type Call1 = unsafe extern "C" fn(Context, usize);
type Call2 = unsafe extern "C" fn(Context, usize, usize);
type Call3 = unsafe extern "C" fn(Context, usize, usize, usize);

/// A oneTBB arena, on C++'s heap.
#[repr(C)]
struct Arena {
    _private: [u8; 0],
}

unsafe extern "C" {
    fn dualframe_openmp_parallel(threads: c_int, context: Context, thread: Call1);
    fn dualframe_openmp_static(items: usize, context: Context, item: Call1);
    fn dualframe_openmp_dynamic(items: usize, context: Context, item: Call1);
    fn dualframe_tbb_new(threads: c_int, most: usize) -> NonNull<Arena>;
    fn dualframe_tbb_delete(arena: NonNull<Arena>);
    fn dualframe_tbb_for(arena: NonNull<Arena>, items: usize, context: Context, part: Call3);
    fn dualframe_tbb_pipeline(
        arena: NonNull<Arena>,
        items: usize,
        work_context: Context,
        work: Call2,
        finish_context: Context,
        finish: Call2,
    );
}

/// An OpenMP parallel loop with `schedule(static)`, or with `schedule(dynamic)`.
#[derive(Debug)]
pub struct OpenMp<const DYNAMIC: bool> {
    threads: c_int,
}

impl<const DYNAMIC: bool> ParallelFor for OpenMp<DYNAMIC> {
    const IN_ORDER: bool = DYNAMIC;

    fn new(threads: usize) -> Result<Self, ExecutorError> {
        Ok(Self { threads: threads as c_int })
    }

    fn for_each<T: Send, S>(
        &self,
        items: &mut [T],
        begin: impl Fn(usize) -> S + Sync + Send,
        body: impl Fn(&mut S, usize, &mut T) + Sync + Send,
    ) {
        let (count, items, caught) = (items.len(), Items::new(items), Caught::default());
        let thread = |worker| {
            let state = RefCell::new(begin(worker));
            let item = |index| {
                // SAFETY: a worksharing loop gives every index to one thread, once.
                let item = unsafe { items.lend(index) };
                caught.run(|| body(&mut state.borrow_mut(), index, item));
            };
            let share = if DYNAMIC { dualframe_openmp_dynamic } else { dualframe_openmp_static };
            // SAFETY: this is inside a parallel region, every thread of which comes here; `item` is
            // alive until the call returns.
            unsafe { share(count, context(&item), call1(&item)) };
        };
        // SAFETY: `thread` may be called on several threads at once, and is alive until all of them
        // have returned, which is when the call returns.
        unsafe { dualframe_openmp_parallel(self.threads, context(&thread), call1(&thread)) };
        caught.resume();
    }
}

/// A oneTBB arena of so many threads, the calling one included.
#[derive(Debug)]
pub struct Tbb {
    arena: NonNull<Arena>,
}

// SAFETY: oneTBB allows work in an arena to be started by any thread, by several at once too.
unsafe impl Sync for Tbb {}

// SAFETY: an arena belongs to no thread.
unsafe impl Send for Tbb {}

impl Tbb {
    /// Items in their order through three filters: a source, `work(worker, index, item)` in parallel,
    /// and `finish(worker, index, item)` one after the other in order.
    pub(super) fn pipeline<'a, T: Send>(
        &self,
        items: &'a mut [T],
        work: impl Fn(usize, usize, &mut T) + Sync,
        finish: impl FnMut(usize, usize, &'a mut T) + Send,
    ) {
        if items.is_empty() {
            return;
        }
        let (count, items, caught) = (items.len(), Items::new(items), Caught::default());
        let work = |worker, index| {
            // SAFETY: the source gives every number once, and no other filter has it now.
            let item = unsafe { items.lend(index) };
            caught.run(|| work(worker, index, item));
        };
        // The lock is free: the filter is serial.
        let finish = Mutex::new(finish);
        let finish = |worker, index| {
            // SAFETY: the source gives every number once, and this is the last filter that has it.
            let item = unsafe { items.lend(index) };
            let mut finish = finish.lock().unwrap_or_else(PoisonError::into_inner);
            // Nobody is to be given what a panic has left.
            if !caught.has_any() {
                caught.run(|| finish(worker, index, item));
            }
        };
        // SAFETY: the arena is alive as long as `self`. Both closures may be called on any of its
        // threads, and are alive until the pipeline is empty, which is when the call returns.
        unsafe {
            let (first, last) = (context(&work), context(&finish));
            dualframe_tbb_pipeline(self.arena, count, first, call2(&work), last, call2(&finish));
        }
        caught.resume();
    }
}

impl ParallelFor for Tbb {
    fn new(threads: usize) -> Result<Self, ExecutorError> {
        // SAFETY: the number is at least 1, as both of oneTBB's constructors ask.
        Ok(Self { arena: unsafe { dualframe_tbb_new(threads as c_int, MAX_THREADS) } })
    }

    fn for_each<T: Send, S>(
        &self,
        items: &mut [T],
        begin: impl Fn(usize) -> S + Sync + Send,
        body: impl Fn(&mut S, usize, &mut T) + Sync + Send,
    ) {
        let (count, items, caught) = (items.len(), Items::new(items), Caught::default());
        let part = |worker, first, end| {
            caught.run(|| {
                let mut state = begin(worker);
                for index in first..end {
                    // SAFETY: the parts of a range do not overlap, and each is given once.
                    body(&mut state, index, unsafe { items.lend(index) });
                }
            });
        };
        // SAFETY: the arena is alive as long as `self`. `part` may be called on any of its threads,
        // and is alive until the loop has ended, which is when the call returns.
        unsafe { dualframe_tbb_for(self.arena, count, context(&part), call3(&part)) };
        caught.resume();
    }
}

impl Drop for Tbb {
    fn drop(&mut self) {
        // SAFETY: it came from `dualframe_tbb_new`, and nobody has it any more.
        unsafe { dualframe_tbb_delete(self.arena) };
    }
}

/// A slice whose items are lent one by one to whichever thread has their number.
struct Items<'a, T> {
    first: *mut T,
    count: usize,
    slice: PhantomData<&'a mut [T]>,
}

// SAFETY: all that threads can do with it is to borrow items, each by one thread at a time; `T: Send`
// is what that needs.
unsafe impl<T: Send> Sync for Items<'_, T> {}

impl<'a, T> Items<'a, T> {
    fn new(items: &'a mut [T]) -> Self {
        Self { first: items.as_mut_ptr(), count: items.len(), slice: PhantomData }
    }

    /// # Safety
    /// No other loan of this item may be in use.
    unsafe fn lend(&self, index: usize) -> &'a mut T {
        assert!(index < self.count, "a loop beyond its items");
        // SAFETY: it is inside the slice, which is borrowed for `'a`, and the caller sees to it that
        // it is borrowed once.
        unsafe { &mut *self.first.add(index) }
    }
}

/// The first panic of a loop, which must not unwind through C++. The loop goes on to its end.
#[derive(Default)]
struct Caught(Mutex<Option<Box<dyn Any + Send>>>);

impl Caught {
    fn run(&self, work: impl FnOnce()) {
        if let Err(panic) = catch_unwind(AssertUnwindSafe(work)) {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(panic);
        }
    }

    fn has_any(&self) -> bool {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    fn resume(self) {
        if let Some(panic) = self.0.into_inner().unwrap_or_else(PoisonError::into_inner) {
            resume_unwind(panic);
        }
    }
}

fn context<F>(work: &F) -> Context {
    std::ptr::from_ref(work).cast()
}

/// What calls a closure of this type. A panic that got here would end the process.
fn call1<F: Fn(usize)>(_: &F) -> Call1 {
    unsafe extern "C" fn call<F: Fn(usize)>(work: Context, a: usize) {
        // SAFETY: it came from `context` on an `F` that is alive.
        unsafe { (*work.cast::<F>())(a) }
    }
    call::<F>
}

/// As [`call1`].
fn call2<F: Fn(usize, usize)>(_: &F) -> Call2 {
    unsafe extern "C" fn call<F: Fn(usize, usize)>(work: Context, a: usize, b: usize) {
        // SAFETY: it came from `context` on an `F` that is alive.
        unsafe { (*work.cast::<F>())(a, b) }
    }
    call::<F>
}

/// As [`call1`].
fn call3<F: Fn(usize, usize, usize)>(_: &F) -> Call3 {
    unsafe extern "C" fn call<F>(work: Context, a: usize, b: usize, c: usize)
    where
        F: Fn(usize, usize, usize),
    {
        // SAFETY: it came from `context` on an `F` that is alive.
        unsafe { (*work.cast::<F>())(a, b, c) }
    }
    call::<F>
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;
    use std::thread;
    use std::time::{Duration, Instant};

    use super::*;

    const ITEMS: usize = 500;

    /// Every item once, worker numbers below the number of threads, and a panic that comes back.
    fn check<P: ParallelFor>() {
        for threads in 1..=4 {
            let loops = P::new(threads).expect("threads");
            let mut counts = vec![0; ITEMS];
            let body = |worker: &mut usize, index: usize, count: &mut usize| {
                assert!(*worker < threads);
                *count += index;
            };
            loops.for_each(&mut counts, |worker| worker, body);
            assert!(counts.into_iter().eq(0..ITEMS));

            let fails = |_: &mut (), index, done: &mut bool| {
                assert_ne!(index, 7, "the seventh");
                *done = true;
            };
            let mut done = vec![false; ITEMS];
            let failed = catch_unwind(AssertUnwindSafe(|| {
                loops.for_each(&mut done, |_| (), fails);
            }));
            assert!(failed.is_err() && !done[7]);
            loops.for_each(&mut [0_u8; 0], |_| (), |(), _, _| unreachable!("no items"));
        }
    }

    #[test]
    fn openmp_static() {
        check::<OpenMp<false>>();
    }

    #[test]
    fn openmp_static_shares_evenly_what_divides_but_for_the_last() {
        for (threads, each) in [(2, 2), (2, 5), (3, 2), (4, 3)] {
            let loops = OpenMp::<false>::new(threads).expect("threads");
            let mut sharers = vec![usize::MAX; threads * each + 1];
            loops.for_each(
                &mut sharers,
                |worker| worker,
                |&mut worker, _, sharer| *sharer = worker,
            );
            let alike = &sharers[..threads * each];
            let most = (0..threads).map(|of| alike.iter().filter(|&&it| it == of).count()).max();
            assert_eq!(most, Some(each), "{threads} threads: {sharers:?}");
        }
    }

    #[test]
    fn openmp_dynamic() {
        check::<OpenMp<true>>();
    }

    #[test]
    fn tbb_for() {
        check::<Tbb>();
    }

    #[test]
    fn tbb_pipeline() {
        for threads in 1..=4 {
            let loops = Tbb::new(threads).expect("threads");
            let mut counts = vec![0; ITEMS];
            let mut finished = Vec::new();
            let work = |worker: usize, index: usize, count: &mut usize| {
                assert!(worker < threads);
                *count += index;
            };
            loops.pipeline(&mut counts, work, |_, index, count| finished.push((index, *count)));
            assert!(finished.into_iter().eq((0..ITEMS).map(|index| (index, index))));

            let failed = catch_unwind(AssertUnwindSafe(|| {
                let finish = |_, index, _: &mut _| assert_ne!(index, 7, "the seventh");
                loops.pipeline(&mut counts, |_, _, _| (), finish);
            }));
            assert!(failed.is_err());
        }
    }

    #[test]
    fn an_arena_beside_another_has_all_its_threads() {
        let [few, many] = [1, 2].map(|threads| Tbb::new(threads).expect("an arena"));
        let seen = Mutex::new(HashSet::new());
        let began = Instant::now();
        let both = || seen.lock().expect("no panic").len() == 2;
        many.for_each(
            &mut [(); 64],
            |_| (),
            |_, _, _| {
                seen.lock().expect("no panic").insert(thread::current().id());
                while !both() && began.elapsed() < Duration::from_secs(20) {
                    thread::yield_now();
                }
            },
        );
        assert!(both(), "one thread did it all");
        drop(few);
    }
}
