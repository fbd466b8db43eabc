//! Points that fill a cube evenly, however many there are.

/// Of each axis the fraction by which the sequence steps: the roots of x⁴ = x + 1.
const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_4];

/// The index-th point of the unit cube (Kronecker's sequence, after M. Roberts' generalisation of the golden ratio).
pub fn spread(index: usize) -> [f32; 3] {
    STEPS.map(|step| {
        let at = 0.5 + step * (index + 1) as f64;
        (at - libm::floor(at)) as f32
    })
}
