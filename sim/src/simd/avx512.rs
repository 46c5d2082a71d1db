//! Sixteen lanes in one register, and all nodes of a small body in nine, where permutations look them
//! up.

use std::arch::x86_64::*;

use super::avx2::{Avx2, Avx2Half, align_stack};
use super::{Arithmetic, Isa, Kernel, LaneSet, Lanes3, Quad};
use crate::geometry::{LANES, Lanes};

/// The proof that the machine has AVX-512F and AVX-512VL. There is none without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Avx512(Avx2);

impl Avx512 {
    /// The most chunks of nodes among which a kernel can look up.
    pub(super) const MOST_CHUNKS: usize = 3;

    pub(super) fn detect() -> Option<Self> {
        let avx2 = Avx2::detect()?;
        (is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl"))
            .then_some(Self(avx2))
    }

    pub(super) fn avx2(self) -> Avx2 {
        self.0
    }

    pub(super) fn run<K: Kernel>(self, kernel: K) -> K::Output {
        // SAFETY: the machine has AVX-512F and VL, or there were no `self`.
        unsafe { with_avx512(self, kernel) }
    }
}

#[target_feature(enable = "avx512f,avx512vl")]
fn with_avx512<K: Kernel>(avx512: Avx512, kernel: K) -> K::Output {
    align_stack();
    kernel.run(avx512)
}

impl Arithmetic for Avx512 {
    type Lanes = Lanes;
    type Vector = __m512;

    #[inline(always)]
    fn splat(self, value: f32) -> __m512 {
        // SAFETY: the machine has AVX-512F and VL, or there were no `self`.
        unsafe { _mm512_set1_ps(value) }
    }

    #[inline(always)]
    fn load(self, lanes: &Lanes) -> __m512 {
        // SAFETY: as in `splat`; the pointer is that of sixteen numbers.
        unsafe { _mm512_loadu_ps(lanes.as_ptr()) }
    }

    #[inline(always)]
    fn store(self, vector: __m512, lanes: &mut Lanes) {
        // SAFETY: as in `splat`; the pointer is that of sixteen numbers.
        unsafe { _mm512_storeu_ps(lanes.as_mut_ptr(), vector) }
    }

    #[inline(always)]
    fn add(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: as in `splat`.
        unsafe { _mm512_add_ps(a, b) }
    }

    #[inline(always)]
    fn sub(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: as in `splat`.
        unsafe { _mm512_sub_ps(a, b) }
    }

    #[inline(always)]
    fn mul(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: as in `splat`.
        unsafe { _mm512_mul_ps(a, b) }
    }

    #[inline(always)]
    fn div(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: as in `splat`.
        unsafe { _mm512_div_ps(a, b) }
    }

    #[inline(always)]
    fn sqrt(self, a: __m512) -> __m512 {
        // SAFETY: as in `splat`.
        unsafe { _mm512_sqrt_ps(a) }
    }

    #[inline(always)]
    fn min(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: as in `splat`.
        unsafe { _mm512_min_ps(a, b) }
    }

    #[inline(always)]
    fn max(self, a: __m512, b: __m512) -> __m512 {
        // SAFETY: as in `splat`.
        unsafe { _mm512_max_ps(a, b) }
    }

    #[inline(always)]
    fn choose(self, chooser: __m512, a: __m512, b: __m512) -> __m512 {
        /// For each bit that of the second operand where the first's is set, of the third elsewhere.
        const CHOICE: i32 = 0b1100_1010;
        // SAFETY: as in `splat`.
        unsafe {
            let (a, b) = (_mm512_castps_si512(a), _mm512_castps_si512(b));
            let chooser = _mm512_castps_si512(chooser);
            _mm512_castsi512_ps(_mm512_ternarylogic_epi32::<CHOICE>(chooser, a, b))
        }
    }
}

impl Isa for Avx512 {
    type Half = Avx2Half;
    type Table<'a> = [[__m512; 3]; Avx512::MOST_CHUNKS];

    #[inline(always)]
    fn half(self) -> Avx2Half {
        self.0.half()
    }

    #[inline(always)]
    fn sum(self, vector: __m512) -> f32 {
        // SAFETY: as in `splat`.
        let half = unsafe {
            let upper = _mm512_extractf64x4_pd::<1>(_mm512_castps_pd(vector));
            _mm256_add_ps(_mm512_castps512_ps256(vector), _mm256_castpd_ps(upper))
        };
        self.half().sum(half)
    }

    #[inline(always)]
    fn less(self, a: __m512, b: __m512) -> LaneSet {
        // SAFETY: as in `splat`.
        unsafe { _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b) }
    }

    #[inline(always)]
    fn at_most(self, a: __m512, b: __m512) -> LaneSet {
        // SAFETY: as in `splat`.
        unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b) }
    }

    #[inline(always)]
    fn compress(
        self,
        kept: LaneSet,
        first: u32,
        vectors: [__m512; 3],
        nodes: &mut [u32; LANES],
        to: [&mut Lanes; 3],
    ) {
        // SAFETY: as in `splat`; the pointer is that of sixteen numbers.
        unsafe {
            let lanes = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
            let numbers = _mm512_add_epi32(_mm512_set1_epi32(first as i32), lanes);
            let numbers = _mm512_maskz_compress_epi32(kept, numbers);
            _mm512_storeu_si512(nodes.as_mut_ptr().cast(), numbers);
        }
        for (axis, to) in to.into_iter().enumerate() {
            // SAFETY: as in `splat`.
            let kept = unsafe { _mm512_maskz_compress_ps(kept, vectors[axis]) };
            self.store(kept, to);
        }
    }

    #[inline(always)]
    fn table<'a>(self, chunks: &[Lanes3], _: &'a mut Vec<Quad>) -> Self::Table<'a> {
        let mut table = [[self.splat(0.0); 3]; Self::MOST_CHUNKS];
        for (chunk, vectors) in table.iter_mut().enumerate() {
            if let Some(Lanes3([x, y, z])) = chunks.get(chunk) {
                *vectors = [self.load(x), self.load(y), self.load(z)];
            }
        }
        table
    }

    #[inline(always)]
    unsafe fn look_up(self, table: Self::Table<'_>, nodes: &[u32; LANES]) -> [__m512; 3] {
        // SAFETY: as in `splat`; the pointer is that of sixteen numbers.
        let (nodes, in_third) = unsafe {
            let nodes = _mm512_loadu_si512(nodes.as_ptr().cast());
            (nodes, _mm512_test_epi32_mask(nodes, _mm512_set1_epi32(32)))
        };
        let mut found = [self.splat(0.0); 3];
        let [first, second, third] = table;
        for axis in 0..3 {
            // SAFETY: as in `splat`.
            found[axis] = unsafe {
                let found = _mm512_permutex2var_ps(first[axis], nodes, second[axis]);
                _mm512_mask_permutexvar_ps(found, in_third, nodes, third[axis])
            };
        }
        found
    }
}
