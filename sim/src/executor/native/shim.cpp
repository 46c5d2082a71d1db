// The native peers' loops: real OpenMP and real oneTBB, called by shim.rs and calling it back.
//
// Callbacks never unwind: shim.rs catches panics. The functions are noexcept, so memory that is not to be had ends the
// process, as it does in Rust. So do threads that are not to be had: OpenMP's runtime knows no other way.

#include <cstddef>
#include <omp.h>
#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>

namespace {

/// Threads for one executor.
struct Arena {
    explicit Arena(int threads) : arena(threads) {}

    tbb::task_arena arena;
};

std::size_t worker() { return static_cast<std::size_t>(tbb::this_task_arena::current_thread_index()); }

} // namespace

extern "C" {

/// Calls `thread(context, worker)` once on each of up to so many threads.
void dualframe_openmp_parallel(int threads, void *context,
                               void (*thread)(void *, std::size_t)) noexcept {
#pragma omp parallel num_threads(threads)
    thread(context, static_cast<std::size_t>(omp_get_thread_num()));
}

/// This thread's part of a loop; to be called by every thread of a parallel region.
///
/// The loop counts down: GCC gives what does not divide to the first threads, and the last block of a room is its
/// walls, which take next to no time. Counting up, the first thread would have two blocks more than the last.
void dualframe_openmp_static(std::size_t items, void *context,
                             void (*item)(void *, std::size_t)) noexcept {
#pragma omp for schedule(static) nowait
    for (std::size_t index = items; index > 0; --index) {
        item(context, index - 1);
    }
}

/// This thread's part of a loop, one item after the other to whoever is free.
void dualframe_openmp_dynamic(std::size_t items, void *context,
                              void (*item)(void *, std::size_t)) noexcept {
#pragma omp for schedule(dynamic) nowait
    for (std::size_t index = 0; index < items; ++index) {
        item(context, index);
    }
}

/// `most` is the greatest number that is ever asked for.
Arena *dualframe_tbb_new(int threads, std::size_t most) noexcept {
    // oneTBB gives no more threads than there are cores unless it is told to; one limit for all arenas, since
    // the least of several counts.
    static const tbb::global_control control(tbb::global_control::max_allowed_parallelism, most);
    return new Arena(threads);
}

void dualframe_tbb_delete(Arena *arena) noexcept { delete arena; }

/// Calls `part(context, worker, begin, end)` for parts that make up 0 to `items`.
void dualframe_tbb_for(Arena *arena, std::size_t items, void *context,
                       void (*part)(void *, std::size_t, std::size_t, std::size_t)) noexcept {
    using Range = tbb::blocked_range<std::size_t>;
    const auto body = [=](const Range &range) {
        part(context, worker(), range.begin(), range.end());
    };
    arena->arena.execute(
        [&] { tbb::parallel_for(Range(0, items), body, tbb::auto_partitioner()); });
}

/// A pipeline of three filters: the numbers below `items` in order; `work`, in parallel; `finish`,
/// one after the other in order. All items may be under way at once.
void dualframe_tbb_pipeline(Arena *arena, std::size_t items, void *work_context,
                            void (*work)(void *, std::size_t, std::size_t), void *finish_context,
                            void (*finish)(void *, std::size_t, std::size_t)) noexcept {
    std::size_t next = 0;
    const auto source = tbb::make_filter<void, std::size_t>(
        tbb::filter_mode::serial_in_order, [&](tbb::flow_control &control) -> std::size_t {
            if (next == items) {
                control.stop();
                return 0;
            }
            return next++;
        });
    const auto parallel = tbb::make_filter<std::size_t, std::size_t>(
        tbb::filter_mode::parallel, [=](std::size_t index) {
            work(work_context, worker(), index);
            return index;
        });
    const auto last = tbb::make_filter<std::size_t, void>(
        tbb::filter_mode::serial_in_order,
        [=](std::size_t index) { finish(finish_context, worker(), index); });
    arena->arena.execute([&] { tbb::parallel_pipeline(items, source & parallel & last); });
}
}
