//! Sorting of the intrusive lists that many push and one reads in a fixed order.

use crate::unit::NONE;

/// Sorts the list that starts at `head` so that no element is `before` its predecessor, and
/// returns the new head. A bottom-up merge sort: no memory, no recursion, O(n log n).
///
/// `next` reads and `link` writes the successor of an element; `NONE` ends the list.
pub(crate) fn sort(
    head: u32,
    next: impl Fn(u32) -> u32,
    link: impl Fn(u32, u32),
    before: impl Fn(u32, u32) -> bool,
) -> u32 {
    let mut head = head;
    let mut width = 1;
    loop {
        let (mut rest, mut tail, mut merges) = (head, NONE, 0);
        head = NONE;
        while rest != NONE {
            merges += 1;
            let (mut left, mut left_size) = (rest, 0);
            while left_size < width && rest != NONE {
                left_size += 1;
                rest = next(rest);
            }
            let mut right_size = width;
            while left_size > 0 || (right_size > 0 && rest != NONE) {
                let from_left =
                    left_size > 0 && (right_size == 0 || rest == NONE || !before(rest, left));
                let taken = if from_left { left } else { rest };
                if from_left {
                    left = next(left);
                    left_size -= 1;
                } else {
                    rest = next(rest);
                    right_size -= 1;
                }
                if tail == NONE {
                    head = taken
                } else {
                    link(tail, taken)
                }
                tail = taken;
            }
        }
        if tail != NONE {
            link(tail, NONE);
        }
        if merges <= 1 {
            return head;
        }
        width *= 2;
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;
    use ::core::cell::Cell;

    #[test]
    fn sorts_every_permutation_of_six() {
        for code in 0..720_usize {
            let (mut left, mut code) = (std::vec![0_u32, 1, 2, 3, 4, 5], code);
            let mut order = std::vec::Vec::new();
            for base in (1..=6).rev() {
                order.push(left.remove(code % base));
                code /= base;
            }
            let links: std::vec::Vec<_> = (0..6).map(|_| Cell::new(NONE)).collect();
            for pair in order.windows(2) {
                links[pair[0] as usize].set(pair[1]);
            }
            let mut at = sort(
                order[0],
                |i| links[i as usize].get(),
                |i, to| links[i as usize].set(to),
                |a, b| a < b,
            );
            for expected in 0..6 {
                assert_eq!(at, expected, "order {order:?}");
                at = links[at as usize].get();
            }
            assert_eq!(at, NONE);
        }
        assert_eq!(sort(NONE, |_| NONE, |_, _| (), |_, _| true), NONE);
    }
}
