//! Low-discrepancy sequence in the unit cube: any number of points covers the cube uniformly.

/// Step along each axis: 1/g, 1/g² and 1/g³ for the root g of x⁴ = x + 1.
const STEPS: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_4];

/// Point `index` of the Kronecker sequence in the unit cube (M. Roberts' generalised golden ratio).
pub fn kronecker_point(index: usize) -> [f32; 3] {
    STEPS.map(|step| {
        let value = 0.5 + step * (index + 1) as f64;
        (value - libm::floor(value)) as f32
    })
}
