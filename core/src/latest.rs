//! A latest-value cell: one writer, many readers, neither ever waits for the other.
//!
//! After M. Ianni, A. Pellegrini, F. Quaglia, "A Wait-free Multi-word Atomic (1,N) Register"
//! (2017): one word holds the newest slot and how many readers have entered it, so that a reader
//! finds the slot and marks itself inside by one `fetch_add`, and the writer, publishing by one
//! `swap`, learns how many it must see leave before it may use the old slot again. Haptics use it
//! (§6.3): the device loop reads force and gradient at its own rate, the pipeline at its own.

use ::core::mem::MaybeUninit;

use crate::error::{Table, TableFull};
use crate::storage::at;
use crate::sync::{Atomic, Cell, const_fn, seeded, site};

const INDEX_BITS: u32 = 8;
const INDEX: u32 = (1 << INDEX_BITS) - 1;
/// Entries are counted modulo 2^24; far fewer readers exist at once.
const ENTRIES: u32 = u32::MAX >> INDEX_BITS;

#[derive(Debug)]
struct Slot<T> {
    value: Cell<T>,
    /// Readers that had entered when the slot was retired. The writer's own note.
    entered: Atomic,
    /// Readers that have left since it was published.
    left: Atomic,
}

impl<T> Slot<T> {
    const_fn! {
        const fn new(value: T) -> Self {
            Self { value: Cell::new(value), entered: Atomic::new(0), left: Atomic::new(0) }
        }
    }
}

/// The cell, with `SLOTS - 2` readers at most; `SLOTS` is 3 to 256.
#[derive(Debug)]
pub struct Latest<T, const SLOTS: usize> {
    slots: [Slot<T>; SLOTS],
    /// Readers that have entered the newest slot, and its index in the low 8 bits.
    newest: Atomic,
    readers: Atomic,
}

impl<T: Copy + Send + Sync, const SLOTS: usize> Latest<T, SLOTS> {
    const SLOTS_FIT: () = assert!(SLOTS >= 3 && SLOTS <= 256, "3 to 256 slots");

    const_fn! {
        /// A cell that holds `value` until the first publication; also in a `static`:
        ///
        /// ```
        /// use dualframe_core::latest::Latest;
        /// use dualframe_core::storage::Static;
        ///
        /// static FORCE: Static<Latest<f32, 3>> = Static::new(Latest::new(0.0));
        ///
        /// let (mut writer, readers) = FORCE.take().expect("nobody has it").split();
        /// let mut reader = readers.reader().expect("one reader");
        /// writer.publish(1.5);
        /// assert_eq!(reader.read(), 1.5);
        /// ```
        pub const fn new(value: T) -> Self {
            let () = Self::SLOTS_FIT;
            let mut slots = [const { MaybeUninit::uninit() }; SLOTS];
            let mut index = 0;
            while index < SLOTS {
                slots[index] = MaybeUninit::new(Slot::new(value));
                index += 1;
            }
            // SAFETY: all of them are there, and an array of `MaybeUninit` has the layout of one without.
            let slots = unsafe { (&raw const slots).cast::<[Slot<T>; SLOTS]>().read() };
            Self { slots, newest: Atomic::new(0), readers: Atomic::new(0) }
        }
    }

    /// The one writer, and the handle that makes readers.
    pub fn split(&mut self) -> (Writer<'_, T, SLOTS>, Readers<'_, T, SLOTS>) {
        let newest = self.newest.load(site::EXCLUSIVE) & INDEX;
        (Writer { cell: self, newest }, Readers { cell: self })
    }

    fn enter(&self) -> u32 {
        self.newest.fetch_add(1 << INDEX_BITS, site::LATEST_ENTER) & INDEX
    }

    fn leave(&self, slot: u32) {
        self.slot(slot).left.fetch_add(1, site::LATEST_LEAVE);
    }

    /// A slot by the index that `newest` holds or held.
    fn slot(&self, index: u32) -> &Slot<T> {
        // SAFETY: it starts as the first one, and only `publish` changes it, to one of all slots.
        unsafe { at(&self.slots, index as usize) }
    }
}

/// Publishes values. There is one: it borrows the cell exclusively through `split`.
#[derive(Debug)]
pub struct Writer<'c, T, const SLOTS: usize> {
    cell: &'c Latest<T, SLOTS>,
    newest: u32,
}

impl<T: Copy + Send + Sync, const SLOTS: usize> Writer<'_, T, SLOTS> {
    /// Makes `value` the newest. Wait-free: at most `SLOTS` slots are looked at.
    pub fn publish(&mut self, value: T) {
        let Some(free) = self.free_slot() else {
            // Never: readers are limited. A cell that kept its value would harm nobody.
            debug_assert!(false, "a reader too many");
            return;
        };
        let slot = self.cell.slot(free);
        // SAFETY: every reader that entered this slot has left it (`free_slot`), and none can
        // enter before the swap below publishes it.
        unsafe { slot.value.with_mut(|place| *place = value) };
        slot.left.store(0, site::SLOT_FIELD);
        let old = self.cell.newest.swap(free, site::LATEST_PUBLISH);
        let retired = self.cell.slot(old & INDEX);
        retired.entered.store(old >> INDEX_BITS, site::SLOT_FIELD);
        self.newest = free;
    }

    /// A slot that nobody is inside. There is one: each reader is inside one slot at most, one is
    /// the newest, and there are two slots more than readers.
    fn free_slot(&self) -> Option<u32> {
        let vacant = |&(index, slot): &(u32, &Slot<T>)| {
            let left = slot.left.load(site::LATEST_REUSE) & ENTRIES;
            let vacant = slot.entered.load(site::SLOT_FIELD) == left;
            index != self.newest && (vacant || seeded!(SlotReusedEarly))
        };
        (0..).zip(&self.cell.slots).find(vacant).map(|(index, _)| index)
    }
}

/// Makes readers; may be shared.
#[derive(Debug)]
pub struct Readers<'c, T, const SLOTS: usize> {
    cell: &'c Latest<T, SLOTS>,
}

impl<T, const SLOTS: usize> Clone for Readers<'_, T, SLOTS> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T, const SLOTS: usize> Copy for Readers<'_, T, SLOTS> {}

impl<'c, T: Copy + Send + Sync, const SLOTS: usize> Readers<'c, T, SLOTS> {
    /// One more reader.
    ///
    /// # Errors
    /// [`TableFull`] if `SLOTS - 2` readers exist.
    pub fn reader(&self) -> Result<Reader<'c, T, SLOTS>, TableFull> {
        let capacity = SLOTS - 2;
        let readers = &self.cell.readers;
        let mut count = readers.load(site::COUNT_LOOK);
        loop {
            // A refused claim leaves no trace: counting it and taking it back would meanwhile
            // refuse others who have room.
            if count as usize >= capacity {
                let needed = count as usize + 1;
                return Err(TableFull { table: Table::Readers, capacity, needed });
            }
            match readers.exchange(count, count + 1, site::READERS_COUNT) {
                Ok(_) => break,
                Err(found) => count = found,
            }
        }
        Ok(Reader { cell: self.cell, inside: self.cell.enter() })
    }
}

/// Reads the newest value. It stays inside the slot that it read last, so that reading an
/// unchanged cell is one load.
#[derive(Debug)]
pub struct Reader<'c, T: Copy + Send + Sync, const SLOTS: usize> {
    cell: &'c Latest<T, SLOTS>,
    inside: u32,
}

impl<T: Copy + Send + Sync, const SLOTS: usize> Reader<'_, T, SLOTS> {
    /// The newest value. Wait-free: no loop.
    pub fn read(&mut self) -> T {
        if self.cell.newest.load(site::LATEST_LOOK) & INDEX != self.inside {
            self.cell.leave(self.inside);
            self.inside = self.cell.enter();
        }
        // SAFETY: this reader is inside the slot, so the writer does not touch it.
        unsafe { self.cell.slot(self.inside).value.with(|value| *value) }
    }
}

impl<T: Copy + Send + Sync, const SLOTS: usize> Drop for Reader<'_, T, SLOTS> {
    fn drop(&mut self) {
        self.cell.leave(self.inside);
        self.cell.readers.fetch_sub(1, site::READERS_COUNT);
    }
}

#[cfg(all(test, not(loom)))]
mod tests {
    use super::*;

    fn reader<'c, const SLOTS: usize>(readers: &Readers<'c, u32, SLOTS>) -> Reader<'c, u32, SLOTS> {
        readers.reader().unwrap_or_else(|full| panic!("{full}"))
    }

    #[test]
    fn readers_see_the_newest() {
        let mut cell = Latest::<u32, 5>::new(0);
        for round in 0..3 {
            let (mut writer, readers) = cell.split();
            let (mut often, mut seldom) = (reader(&readers), reader(&readers));
            for value in 1000 * round + 1..1000 * (round + 1) {
                writer.publish(value);
                let mut new = reader(&readers);
                assert_eq!([new.read(), often.read(), often.read()], [value; 3]);
                if value % 7 == 0 {
                    assert_eq!(seldom.read(), value);
                }
            }
        }
    }
    #[test]
    fn nobody_writes_where_somebody_reads() {
        let mut cell = Latest::<u32, 4>::new(0);
        for round in 1..4 {
            let (mut writer, readers) = cell.split();
            let mut early = reader(&readers);
            let before = early.read();
            writer.publish(100 * round);
            let mut late = reader(&readers);
            let after = late.read();
            (1..20).for_each(|value| writer.publish(100 * round + value));
            for (reader, value) in [(&early, before), (&late, after)] {
                // SAFETY: the reader is inside the slot.
                let kept = unsafe { readers.cell.slot(reader.inside).value.with(|kept| *kept) };
                assert_eq!(kept, value);
            }
        }
    }
}
