//! Custom operations on batches, each with a hand-written gradient.

pub mod chamfer;
pub mod elu_backward;
pub mod fabric_head;
pub mod fourier;
pub mod grad_accumulator;
#[cfg(test)]
mod gradcheck;
pub mod linear;
pub mod linear_max_pool;
pub mod matmul_nt;
pub(crate) mod storage;
