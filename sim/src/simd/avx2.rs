//! Sixteen lanes in two registers; nodes are looked up as quadruples in memory and transposed.

use std::arch::x86_64::*;
use std::hint::black_box;

use super::{Arithmetic, HALF, HalfIsa, HalfLanes, Isa, Kernel, LaneSet, Lanes3, Quad};
use crate::geometry::{LANES, Lanes};

/// The proof that the machine has AVX2. There is none without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Avx2(Avx2Half);

impl Avx2 {
    pub(super) fn detect() -> Option<Self> {
        is_x86_feature_detected!("avx2").then_some(Self(Avx2Half(())))
    }

    pub(super) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        // SAFETY: the machine has AVX2, or there were no `self`.
        unsafe { with_avx2(self, kernel) }
    }

    /// The lanes in which a comparison holds.
    #[inline(always)]
    fn lanes_where<const HOLDS: i32>(self, a: Pair, b: Pair) -> LaneSet {
        // SAFETY: as in `run`.
        let [low, high] = unsafe {
            [
                _mm256_movemask_ps(_mm256_cmp_ps::<HOLDS>(a[0], b[0])),
                _mm256_movemask_ps(_mm256_cmp_ps::<HOLDS>(a[1], b[1])),
            ]
        };
        (low | high << HALF) as LaneSet
    }
}

#[target_feature(enable = "avx2")]
fn with_avx2<K: Kernel>(avx2: Avx2, kernel: K) -> K::Output {
    align_stack();
    kernel.run(avx2)
}

/// A cache line, which no register is longer than.
#[repr(align(64))]
struct Line;

/// Aligns the stack of the function that it is inlined into. The compiler does so only for what is aligned in the
/// source, not for registers that it puts aside later: wherever the thread's stack happens to lie, those then
/// straddle cache lines, and pages where frames took up to 15 % longer.
#[inline(always)]
pub(super) fn align_stack() {
    let line = Line;
    black_box(&line);
}

/// The same proof, for eight lanes in one register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Avx2Half(());

impl Avx2Half {
    /// The sum over the lanes, in halves.
    #[inline(always)]
    pub(super) fn sum(self, half: __m256) -> f32 {
        // SAFETY: the machine has AVX2, or there were no `self`.
        unsafe {
            let four = _mm_add_ps(_mm256_castps256_ps128(half), _mm256_extractf128_ps::<1>(half));
            let two = _mm_add_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_add_ss(two, _mm_movehdup_ps(two)))
        }
    }

    /// Writes the vectors of eight nodes one after the other.
    #[inline(always)]
    fn write_quads(self, [x, y, z]: [__m256; 3], quads: &mut [Quad]) {
        // SAFETY: the machine has AVX2, or there were no `self`.
        let pairs = unsafe {
            let zero = _mm256_setzero_ps();
            let (xz_low, xz_high) = (_mm256_unpacklo_ps(x, z), _mm256_unpackhi_ps(x, z));
            let (y_low, y_high) = (_mm256_unpacklo_ps(y, zero), _mm256_unpackhi_ps(y, zero));
            [
                _mm256_unpacklo_ps(xz_low, y_low),
                _mm256_unpackhi_ps(xz_low, y_low),
                _mm256_unpacklo_ps(xz_high, y_high),
                _mm256_unpackhi_ps(xz_high, y_high),
            ]
        };
        let (low, high) = quads.split_at_mut(HALF / 2);
        for lane in 0..HALF / 2 {
            // SAFETY: as before; each pointer is that of four numbers.
            unsafe {
                let (first, second) =
                    (_mm256_castps256_ps128(pairs[lane]), _mm256_extractf128_ps::<1>(pairs[lane]));
                _mm_storeu_ps(low[lane].as_mut_ptr(), first);
                _mm_storeu_ps(high[lane].as_mut_ptr(), second);
            }
        }
    }

    /// The vectors of eight nodes.
    ///
    /// # Safety
    /// Each of them is in the table.
    #[inline(always)]
    unsafe fn read_quads(self, table: &[Quad], nodes: &[u32]) -> [__m256; 3] {
        let mut pairs = [self.splat(0.0); HALF / 2];
        for (lane, pair) in pairs.iter_mut().enumerate() {
            let (first, second) = (nodes[lane] as usize, nodes[lane + HALF / 2] as usize);
            // SAFETY: the machine has AVX2, or there were no `self`; the caller promises that the
            // nodes are in the table, whose entries are four numbers.
            *pair = unsafe {
                let first = _mm_loadu_ps(table.get_unchecked(first).as_ptr());
                let second = _mm_loadu_ps(table.get_unchecked(second).as_ptr());
                _mm256_insertf128_ps::<1>(_mm256_castps128_ps256(first), second)
            };
        }
        let [a, b, c, d] = pairs;
        // SAFETY: as before.
        unsafe {
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

impl Arithmetic for Avx2Half {
    type Lanes = HalfLanes;
    type Vector = __m256;

    #[inline(always)]
    fn splat(self, value: f32) -> __m256 {
        // SAFETY: the machine has AVX2, or there were no `self`.
        unsafe { _mm256_set1_ps(value) }
    }

    #[inline(always)]
    fn load(self, lanes: &HalfLanes) -> __m256 {
        // SAFETY: as in `splat`; the pointer is that of eight numbers.
        unsafe { _mm256_loadu_ps(lanes.as_ptr()) }
    }

    #[inline(always)]
    fn store(self, vector: __m256, lanes: &mut HalfLanes) {
        // SAFETY: as in `splat`; the pointer is that of eight numbers.
        unsafe { _mm256_storeu_ps(lanes.as_mut_ptr(), vector) }
    }

    #[inline(always)]
    fn add(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: as in `splat`.
        unsafe { _mm256_add_ps(a, b) }
    }

    #[inline(always)]
    fn sub(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: as in `splat`.
        unsafe { _mm256_sub_ps(a, b) }
    }

    #[inline(always)]
    fn mul(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: as in `splat`.
        unsafe { _mm256_mul_ps(a, b) }
    }

    #[inline(always)]
    fn div(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: as in `splat`.
        unsafe { _mm256_div_ps(a, b) }
    }

    #[inline(always)]
    fn sqrt(self, a: __m256) -> __m256 {
        // SAFETY: as in `splat`.
        unsafe { _mm256_sqrt_ps(a) }
    }

    #[inline(always)]
    fn min(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: as in `splat`.
        unsafe { _mm256_min_ps(a, b) }
    }

    #[inline(always)]
    fn max(self, a: __m256, b: __m256) -> __m256 {
        // SAFETY: as in `splat`.
        unsafe { _mm256_max_ps(a, b) }
    }

    #[inline(always)]
    fn choose(self, chooser: __m256, a: __m256, b: __m256) -> __m256 {
        // SAFETY: as in `splat`.
        unsafe { _mm256_or_ps(_mm256_and_ps(chooser, a), _mm256_andnot_ps(chooser, b)) }
    }
}

impl HalfIsa for Avx2Half {
    #[inline(always)]
    fn transpose(self, [a, b, c, d, e, f, g, h]: [__m256; HALF]) -> [__m256; HALF] {
        // SAFETY: the machine has AVX2, or there were no `self`.
        unsafe {
            let [low_a, low_b, low_c, low_d] = transpose_quarters([a, b, c, d]);
            let [high_a, high_b, high_c, high_d] = transpose_quarters([e, f, g, h]);
            [
                _mm256_permute2f128_ps::<0x20>(low_a, high_a),
                _mm256_permute2f128_ps::<0x20>(low_b, high_b),
                _mm256_permute2f128_ps::<0x20>(low_c, high_c),
                _mm256_permute2f128_ps::<0x20>(low_d, high_d),
                _mm256_permute2f128_ps::<0x31>(low_a, high_a),
                _mm256_permute2f128_ps::<0x31>(low_b, high_b),
                _mm256_permute2f128_ps::<0x31>(low_c, high_c),
                _mm256_permute2f128_ps::<0x31>(low_d, high_d),
            ]
        }
    }
}

/// Transposes four by four numbers in either half of the registers.
#[target_feature(enable = "avx2")]
#[inline]
fn transpose_quarters([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    let (ab_low, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
    let (cd_low, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
    [
        _mm256_shuffle_ps::<0b01_00_01_00>(ab_low, cd_low),
        _mm256_shuffle_ps::<0b11_10_11_10>(ab_low, cd_low),
        _mm256_shuffle_ps::<0b01_00_01_00>(ab_high, cd_high),
        _mm256_shuffle_ps::<0b11_10_11_10>(ab_high, cd_high),
    ]
}

/// Two registers.
type Pair = [__m256; 2];

impl Arithmetic for Avx2 {
    type Lanes = Lanes;
    type Vector = Pair;

    #[inline(always)]
    fn splat(self, value: f32) -> Pair {
        [self.0.splat(value); 2]
    }

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> Pair {
        let (halves, _) = lanes.as_chunks();
        [self.0.load(&halves[0]), self.0.load(&halves[1])]
    }

    #[inline(always)]
    fn store(self, vector: Pair, lanes: &mut Lanes) {
        let (halves, _) = lanes.as_chunks_mut();
        self.0.store(vector[0], &mut halves[0]);
        self.0.store(vector[1], &mut halves[1]);
    }

    #[inline(always)]
    fn add(self, a: Pair, b: Pair) -> Pair {
        [self.0.add(a[0], b[0]), self.0.add(a[1], b[1])]
    }

    #[inline(always)]
    fn sub(self, a: Pair, b: Pair) -> Pair {
        [self.0.sub(a[0], b[0]), self.0.sub(a[1], b[1])]
    }

    #[inline(always)]
    fn mul(self, a: Pair, b: Pair) -> Pair {
        [self.0.mul(a[0], b[0]), self.0.mul(a[1], b[1])]
    }

    #[inline(always)]
    fn div(self, a: Pair, b: Pair) -> Pair {
        [self.0.div(a[0], b[0]), self.0.div(a[1], b[1])]
    }

    #[inline(always)]
    fn sqrt(self, a: Pair) -> Pair {
        [self.0.sqrt(a[0]), self.0.sqrt(a[1])]
    }

    #[inline(always)]
    fn min(self, a: Pair, b: Pair) -> Pair {
        [self.0.min(a[0], b[0]), self.0.min(a[1], b[1])]
    }

    #[inline(always)]
    fn max(self, a: Pair, b: Pair) -> Pair {
        [self.0.max(a[0], b[0]), self.0.max(a[1], b[1])]
    }

    #[inline(always)]
    fn choose(self, chooser: Pair, a: Pair, b: Pair) -> Pair {
        [self.0.choose(chooser[0], a[0], b[0]), self.0.choose(chooser[1], a[1], b[1])]
    }
}

impl Isa for Avx2 {
    type Half = Avx2Half;
    type Table<'a> = &'a [Quad];

    #[inline(always)]
    fn half(self) -> Avx2Half {
        self.0
    }

    #[inline(always)]
    fn sum(self, vector: Pair) -> f32 {
        self.0.sum(self.0.add(vector[0], vector[1]))
    }

    #[inline(always)]
    fn less(self, a: Pair, b: Pair) -> LaneSet {
        self.lanes_where::<_CMP_LT_OQ>(a, b)
    }

    #[inline(always)]
    fn at_most(self, a: Pair, b: Pair) -> LaneSet {
        self.lanes_where::<_CMP_LE_OQ>(a, b)
    }

    #[inline(always)]
    fn table<'a>(self, chunks: &[Lanes3], room: &'a mut Vec<Quad>) -> &'a [Quad] {
        let len = chunks.len() * LANES;
        if room.len() < len {
            room.resize(len, [0.0; 4]);
        }
        let quads = &mut room[..len];
        for (quads, Lanes3([x, y, z])) in quads.chunks_exact_mut(LANES).zip(chunks) {
            let (x, y, z) = (self.load(x), self.load(y), self.load(z));
            for (half, quads) in quads.chunks_exact_mut(HALF).enumerate() {
                self.0.write_quads([x[half], y[half], z[half]], quads);
            }
        }
        quads
    }

    #[inline(always)]
    unsafe fn look_up(self, table: &[Quad], nodes: &[u32; LANES]) -> [Pair; 3] {
        let (low, high) = nodes.split_at(HALF);
        // SAFETY: the caller promises that they are in the table.
        let (low, high) =
            unsafe { (self.0.read_quads(table, low), self.0.read_quads(table, high)) };
        [[low[0], high[0]], [low[1], high[1]], [low[2], high[2]]]
    }
}
