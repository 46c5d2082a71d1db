//! Which interactions are modelled: by the groups of the two objects.

use thiserror::Error;

use super::{Detection, Member, Response};
use crate::object::{Group, Object};

/// The interaction pair (§4.1, Fig. 3): algorithms for detection and response.
pub struct InteractionPair {
    /// Finds where the objects touch.
    pub detection: Box<dyn Detection>,
    /// Says what that does to them.
    pub response: Box<dyn Response>,
}

/// Why an interaction cannot be modelled.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
pub enum RuleError {
    /// A group's number is too great.
    #[error("group {group} does not exist: groups are numbered from 0 to {}", Group::COUNT - 1)]
    NoSuchGroup {
        /// The group's number.
        group: u8,
    },
    /// The two groups have a rule already.
    #[error("the interaction of groups {first} and {second} is modelled already")]
    Taken {
        /// The one group.
        first: u8,
        /// The other.
        second: u8,
    },
}

/// The modelled interactions: the Object Interaction Manager's complete set of pairs (§6.1), said by
/// groups of objects rather than one by one. Groups without a rule never interact.
#[derive(Default)]
pub struct Rules {
    pairs: Vec<(Group, Group, InteractionPair)>,
    /// For each group a bit for every group that it has a rule with.
    partners: [u32; Group::COUNT],
}

impl Rules {
    /// No interaction at all.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Models the interaction of two groups. The pair's first object is the one of group `first`;
    /// within one group, the one of lower number.
    ///
    /// # Errors
    /// A group past the last, or two groups that have a rule already.
    pub fn model(
        &mut self,
        first: Group,
        second: Group,
        pair: InteractionPair,
    ) -> Result<(), RuleError> {
        for Group(group) in [first, second] {
            if usize::from(group) >= Group::COUNT {
                return Err(RuleError::NoSuchGroup { group });
            }
        }
        if self.apply(group_set(first), group_set(second)) {
            return Err(RuleError::Taken { first: first.0, second: second.0 });
        }
        self.pairs.push((first, second, pair));
        self.partners[usize::from(first.0)] |= group_set(second);
        self.partners[usize::from(second.0)] |= group_set(first);
        Ok(())
    }

    /// Whether the interaction of two objects is modelled.
    #[must_use]
    pub fn interact(&self, a: &Object, b: &Object) -> bool {
        !a.is_solitary()
            && !b.is_solitary()
            && self.apply(group_set(a.group()), group_set(b.group()))
    }

    /// Whether there is a rule for any group of the one set and any of the other.
    pub(crate) fn apply(&self, a: u32, b: u32) -> bool {
        self.partners
            .iter()
            .enumerate()
            .any(|(group, partners)| a >> group & 1 == 1 && partners & b != 0)
    }

    /// For each group a bit for every group that it has a rule with.
    pub(crate) fn partners(&self) -> [u32; Group::COUNT] {
        self.partners
    }

    /// The rule for two objects, and the objects in the rule's order.
    pub(crate) fn find<'o>(
        &self,
        a: Member<'o>,
        b: Member<'o>,
    ) -> Option<(&InteractionPair, [Member<'o>; 2])> {
        let (low, high) = if a.object.id() < b.object.id() { (a, b) } else { (b, a) };
        let groups = [low, high].map(|end| end.object.group());
        self.pairs.iter().find_map(|(first, second, pair)| {
            if groups == [*first, *second] {
                Some((pair, [low, high]))
            } else if groups == [*second, *first] {
                Some((pair, [high, low]))
            } else {
                None
            }
        })
    }
}

/// The set of one group. Groups past the last belong to no set.
pub(crate) fn group_set(group: Group) -> u32 {
    1_u32.checked_shl(u32::from(group.0)).unwrap_or(0)
}
