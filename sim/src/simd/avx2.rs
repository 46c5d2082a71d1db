//! Sixteen lanes in two registers; nodes are looked up as quadruples in memory and transposed.

use std::arch::x86_64::*;

use super::{Isa, Kernel, Lanes3, Quad, quads};
use crate::geometry::{LANES, Lanes};

/// Lanes of one register.
const HALF: usize = LANES / 2;

/// The proof that the machine has AVX2. There is none without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Avx2(());

impl Avx2 {
    pub(super) fn detect() -> Option<Self> {
        is_x86_feature_detected!("avx2").then_some(Self(()))
    }

    pub(super) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        // SAFETY: the machine has AVX2, or there were no `self`.
        unsafe { with_avx2(self, kernel) }
    }

    /// The vectors of eight nodes, each of which is in the table.
    ///
    /// # Safety
    /// Each of them is in the table.
    #[inline(always)]
    unsafe fn transpose(self, table: &[Quad], nodes: &[u32]) -> [__m256; 3] {
        // SAFETY: the machine has AVX2, or there were no `self`; the nodes are in the table.
        unsafe {
            let quad = |lane: usize| {
                _mm_loadu_ps(table.as_ptr().add(*nodes.get_unchecked(lane) as usize).cast())
            };
            let pair = |lane: usize| {
                _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(quad(lane)), quad(lane + 4))
            };
            let (a, b, c, d) = (pair(0), pair(1), pair(2), pair(3));
            let (xy_ab, xy_cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
            let (z_ab, z_cd) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
            [
                _mm256_shuffle_ps::<0b01_00_01_00>(xy_ab, xy_cd),
                _mm256_shuffle_ps::<0b11_10_11_10>(xy_ab, xy_cd),
                _mm256_shuffle_ps::<0b01_00_01_00>(z_ab, z_cd),
            ]
        }
    }
}

#[target_feature(enable = "avx2")]
fn with_avx2<K: Kernel>(avx2: Avx2, kernel: K) -> K::Output {
    kernel.run(avx2)
}

/// Two registers.
type Pair = [__m256; 2];

impl Isa for Avx2 {
    type Vector = Pair;
    type Table<'a> = &'a [Quad];

    #[inline(always)]
    fn splat(self, value: f32) -> Pair {
        // SAFETY: the machine has AVX2, or there were no `self`.
        unsafe { [_mm256_set1_ps(value); 2] }
    }

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> Pair {
        let (low, high) = lanes.split_at(HALF);
        // SAFETY: as in `splat`; each pointer is that of eight numbers.
        unsafe { [_mm256_loadu_ps(low.as_ptr()), _mm256_loadu_ps(high.as_ptr())] }
    }

    #[inline(always)]
    fn store(self, vector: Pair, lanes: &mut Lanes) {
        let (low, high) = lanes.split_at_mut(HALF);
        // SAFETY: as in `splat`; each pointer is that of eight numbers.
        unsafe {
            _mm256_storeu_ps(low.as_mut_ptr(), vector[0]);
            _mm256_storeu_ps(high.as_mut_ptr(), vector[1]);
        }
    }

    #[inline(always)]
    fn add(self, a: Pair, b: Pair) -> Pair {
        // SAFETY: as in `splat`.
        unsafe { [_mm256_add_ps(a[0], b[0]), _mm256_add_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn sub(self, a: Pair, b: Pair) -> Pair {
        // SAFETY: as in `splat`.
        unsafe { [_mm256_sub_ps(a[0], b[0]), _mm256_sub_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn mul(self, a: Pair, b: Pair) -> Pair {
        // SAFETY: as in `splat`.
        unsafe { [_mm256_mul_ps(a[0], b[0]), _mm256_mul_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn div(self, a: Pair, b: Pair) -> Pair {
        // SAFETY: as in `splat`.
        unsafe { [_mm256_div_ps(a[0], b[0]), _mm256_div_ps(a[1], b[1])] }
    }

    #[inline(always)]
    fn sqrt(self, a: Pair) -> Pair {
        // SAFETY: as in `splat`.
        unsafe { [_mm256_sqrt_ps(a[0]), _mm256_sqrt_ps(a[1])] }
    }

    #[inline(always)]
    fn table<'a>(self, chunks: &[Lanes3], room: &'a mut Vec<Quad>) -> &'a [Quad] {
        quads(chunks, room)
    }

    #[inline(always)]
    fn look_up(self, table: &[Quad], nodes: &[u32; LANES]) -> [Pair; 3] {
        // SAFETY: as in `splat`; the pointers are those of eight numbers each.
        let greatest = unsafe {
            let low = _mm256_loadu_si256(nodes.as_ptr().cast());
            let high = _mm256_loadu_si256(nodes[HALF..].as_ptr().cast());
            let last = _mm256_set1_epi32(table.len() as i32 - 1);
            let greatest = _mm256_max_epu32(low, high);
            _mm256_movemask_epi8(_mm256_cmpeq_epi32(_mm256_max_epu32(greatest, last), last))
        };
        // One comparison for all sixteen.
        assert!(greatest == -1 && !table.is_empty(), "a node past the last");
        // SAFETY: they are in the table.
        let (low, high) = unsafe {
            (self.transpose(table, &nodes[..HALF]), self.transpose(table, &nodes[HALF..]))
        };
        [[low[0], high[0]], [low[1], high[1]], [low[2], high[2]]]
    }
}
