//! Weights from safetensors bytes: half or single precision, checked by name and shape.

use half::f16;
use safetensors::{Dtype, SafeTensors};
use std::collections::HashMap;

/// Why weights cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum WeightsError {
    /// Not a safetensors file, or damaged.
    #[error("the weights are not a safetensors file, or it is damaged: {0}")]
    Format(#[from] safetensors::SafeTensorError),
    /// A tensor is missing.
    #[error("the weights lack the tensor {0}; they belong to another architecture")]
    Missing(String),
    /// A tensor has another shape or type.
    #[error("the tensor {name} should be {wanted:?} in f16 or f32, found {found:?} in {dtype:?}")]
    Shape {
        /// Tensor name.
        name: String,
        /// Shape that is needed.
        wanted: Vec<usize>,
        /// Shape in the file.
        found: Vec<usize>,
        /// Type in the file.
        dtype: Dtype,
    },
    /// A value is not finite.
    #[error("the tensor {0} holds a value that is not finite")]
    NotFinite(String),
    /// What the starts are said to be of does not fit them.
    #[error(
        "the file does not tell of which objects its starts are: {0}; write it again with `ngf train`"
    )]
    Objects(String),
    /// An attempt would begin where the robot cannot be.
    #[error("start {0} is beyond the limits of the joints; write the model again with `ngf train`")]
    Start(usize),
    /// A value of the configuration cannot be used.
    #[error("the model's configuration has {name} = {value}; write it again with `ngf train`")]
    Setting {
        /// Name of the value.
        name: String,
        /// The value.
        value: String,
    },
    /// Weights and starts mean something else.
    #[error("the model is of version {found}, this program runs version {wanted}; train it again")]
    Version {
        /// Version of the model.
        found: u32,
        /// Version that runs.
        wanted: u32,
    },
    /// The configuration beside the weights does not parse.
    #[error("the model's configuration is not valid: {0}")]
    Config(#[from] serde_json::Error),
}

/// A parsed weights file.
pub struct Tensors<'a> {
    tensors: SafeTensors<'a>,
    notes: HashMap<String, String>,
}

impl<'a> Tensors<'a> {
    /// Parses the bytes; they are not copied.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, WeightsError> {
        let tensors = SafeTensors::deserialize(bytes)?;
        let (_, header) = SafeTensors::read_metadata(bytes)?;
        Ok(Self { tensors, notes: header.metadata().clone().unwrap_or_default() })
    }

    /// A note in the file's header.
    pub fn note(&self, name: &str) -> Option<&str> {
        self.notes.get(name).map(String::as_str)
    }

    /// Values of a tensor in half precision, row-major; single precision is rounded to the nearest.
    pub fn get_half(&self, name: &str, shape: &[usize]) -> Result<Vec<f16>, WeightsError> {
        let values: Vec<f16> = self.get(name, shape)?.into_iter().map(f16::from_f32).collect();
        if !values.iter().all(|x| x.is_finite()) {
            return Err(WeightsError::NotFinite(name.to_owned()));
        }
        Ok(values)
    }

    /// Values of a tensor in single precision, row-major.
    pub fn get(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, WeightsError> {
        let tensor =
            self.tensors.tensor(name).map_err(|_| WeightsError::Missing(name.to_owned()))?;
        let bytes = tensor.data();
        let values: Vec<f32> = match tensor.dtype() {
            Dtype::F16 if tensor.shape() == shape => {
                bytes.chunks_exact(2).map(|b| f16::from_le_bytes([b[0], b[1]]).to_f32()).collect()
            }
            Dtype::F32 if tensor.shape() == shape => bytes
                .chunks_exact(4)
                .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect(),
            dtype => {
                return Err(WeightsError::Shape {
                    name: name.to_owned(),
                    wanted: shape.to_vec(),
                    found: tensor.shape().to_vec(),
                    dtype,
                });
            }
        };
        if !values.iter().all(|x| x.is_finite()) {
            return Err(WeightsError::NotFinite(name.to_owned()));
        }
        Ok(values)
    }

    /// Shape of a tensor.
    pub fn shape(&self, name: &str) -> Result<Vec<usize>, WeightsError> {
        let tensor =
            self.tensors.tensor(name).map_err(|_| WeightsError::Missing(name.to_owned()))?;
        Ok(tensor.shape().to_vec())
    }
}
