//! Inboxes: what is posted arrives once, in order, in the next frame; a full pool gives it back.

use super::{Model, Role, check, lend, lend_slice, together};
use dualframe_core_model::frame::Frame;
use dualframe_core_model::inbox::{From, Inbox, LetterSlot, Post};
use dualframe_core_model::ring::{QueueSlot, slots_for};

pub(crate) const ALL: &[Model] = &[
    ("inbox::one_letter", one_letter),
    ("inbox::two_senders", two_senders),
    ("inbox::this_frame_stays", this_frame_stays),
    ("inbox::full_pool", full_pool),
];

fn post(letters: usize) -> &'static Post<'static, u32> {
    let slots = lend_slice(letters, |_| LetterSlot::new());
    let queue = lend_slice(slots_for(letters), |_| QueueSlot::new());
    lend(Post::new(slots, queue).unwrap())
}

fn inbox() -> &'static Inbox {
    // SAFETY: every model has one pool.
    lend(unsafe { Inbox::new() })
}

fn from(sender: u32, sequence: u32) -> From {
    From { sender, sequence }
}

/// The letters due in `frame`, as sender · 10 + sequence; each with the message that went with it.
fn collect(post: &Post<'static, u32>, inbox: &Inbox, frame: u32) -> Vec<u32> {
    let letters = post.collect(inbox, Frame(frame)).map(|(from, message)| {
        let rank = from.sender * 10 + from.sequence;
        assert_eq!(message, 100 + rank, "the message that was posted");
        rank
    });
    letters.collect()
}

/// One sender, one letter: it is there or not yet, and when it is, so is its message.
fn one_letter() {
    check("inbox::one_letter", None, 2, [0, 1], |order| {
        let (post, inbox) = (post(1), inbox());
        let send: Role<usize> = Box::new(move || {
            post.post(inbox, Frame(0), from(1, 0), 110).unwrap();
            0
        });
        let receive: Role<usize> = Box::new(move || collect(post, inbox, 1).len());
        together(order, vec![send, receive])[1]
    });
}

/// Two senders, one of two letters: whatever the receiver sees is in the order of (sender,
/// sequence), and what it does not see yet comes later, once.
fn two_senders() {
    // A sender's first letter is there before its second.
    let expected = [&[][..], &[10], &[20], &[20, 21], &[10, 20], &[10, 20, 21]];
    let expected = expected.map(<[u32]>::to_vec);
    check("inbox::two_senders", Some(2), 3, expected, |order| {
        let (post, inbox) = (post(3), inbox());
        let send = move |sender: u32, count: u32| -> Role<Vec<u32>> {
            Box::new(move || {
                for sequence in 0..count {
                    let message = 100 + sender * 10 + sequence;
                    post.post(inbox, Frame(0), from(sender, sequence), message).unwrap();
                }
                Vec::new()
            })
        };
        let receive = Box::new(move || collect(post, inbox, 1));
        let mut seen = together(order, vec![send(2, 2), send(1, 1), receive]);
        let first = seen.remove(2);
        assert!(first.is_sorted(), "by (sender, sequence)");
        let rest = collect(post, inbox, 1);
        assert!(rest.is_sorted(), "by (sender, sequence)");
        let mut all = [first.clone(), rest].concat();
        all.sort_unstable();
        assert_eq!(all, [10, 20, 21], "each letter once");
        first
    });
}

/// The receiver of frame 1 takes what was posted in frame 0 and puts back what is of frame 1 while
/// a sender posts more of it; nothing is lost, and nothing of frame 1 comes early. The outcome is what
/// the receiver then sees of frame 1: the sender's letter is there or not yet.
fn this_frame_stays() {
    let expected = [&[11][..], &[11, 20]].map(<[u32]>::to_vec);
    check("inbox::this_frame_stays", Some(3), 2, expected, |order| {
        let (post, inbox) = (post(3), inbox());
        post.post(inbox, Frame(0), from(1, 0), 110).unwrap();
        post.post(inbox, Frame(1), from(1, 1), 111).unwrap();
        let send: Role<Vec<u32>> = Box::new(move || {
            post.post(inbox, Frame(1), from(2, 0), 120).unwrap();
            Vec::new()
        });
        let receive: Role<Vec<u32>> = Box::new(move || {
            assert_eq!(collect(post, inbox, 1), [10], "letters of frame 0, in frame 1");
            collect(post, inbox, 2)
        });
        let seen = together(order, vec![send, receive]).remove(1);
        let all = [seen.clone(), collect(post, inbox, 2)].concat();
        assert_eq!(all, [11, 20], "letters of frame 1, in frame 2, each once");
        seen
    });
}

/// Room for one letter, two senders and a receiver: a refused sender has its message back, and
/// whatever was not refused arrives.
fn full_pool() {
    // The first, the second, or, with a collection in between, neither is refused.
    let expected = [[true, true], [true, false], [false, true]];
    check("inbox::full_pool", Some(3), 3, expected, |order| {
        let (post, inbox) = (post(1), inbox());
        let send = move |sender: u32| -> Role<Vec<u32>> {
            Box::new(move || {
                let message = 100 + sender * 10;
                match post.post(inbox, Frame(0), from(sender, 0), message) {
                    Ok(()) => vec![sender * 10],
                    Err(rejected) => {
                        assert_eq!(rejected.message, message, "the message comes back");
                        Vec::new()
                    }
                }
            })
        };
        let receive = Box::new(move || collect(post, inbox, 1));
        let mut seen = together(order, vec![send(1), send(2), receive]);
        let mut arrived = [seen.remove(2), collect(post, inbox, 1)].concat();
        arrived.sort_unstable();
        assert_eq!(arrived, seen.concat(), "what was posted arrives");
        [!seen[0].is_empty(), !seen[1].is_empty()]
    });
}
