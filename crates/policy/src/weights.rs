//! Loading of weights from safetensors: half or single precision, checked by name and shape.

use half::f16;
use safetensors::{Dtype, SafeTensors};
use std::collections::HashMap;

/// Why a model file cannot be loaded.
#[derive(Debug, thiserror::Error)]
pub enum WeightsError {
    /// The file is not a safetensors file, or is damaged.
    #[error("the file is damaged or is not a safetensors file: {0}")]
    Format(#[from] safetensors::SafeTensorError),
    /// A tensor is missing.
    #[error("missing tensor {0}: the weights belong to another architecture")]
    MissingTensor(String),
    /// A tensor has another shape or type.
    #[error("tensor {name} must have shape {wanted:?} in f16 or f32; found {found:?} in {dtype:?}")]
    Shape {
        /// Name of the tensor.
        name: String,
        /// Expected shape.
        wanted: Vec<usize>,
        /// Shape in the file.
        found: Vec<usize>,
        /// Type in the file.
        dtype: Dtype,
    },
    /// A value is not finite.
    #[error("tensor {0} has a value that is not finite")]
    NotFinite(String),
    /// The stored object names do not match the start configurations.
    #[error(
        "the object names of the start configurations are not valid: {0}; export the model again with `ngf train`"
    )]
    ObjectNames(String),
    /// A start configuration exceeds the joint limits.
    #[error(
        "start configuration {0} exceeds the joint limits; export the model again with `ngf train`"
    )]
    StartBeyondLimits(usize),
    /// A value of the configuration is invalid.
    #[error(
        "invalid model configuration: {name} = {value}; export the model again with `ngf train`"
    )]
    InvalidValue {
        /// Name of the field or tensor.
        name: String,
        /// The invalid value.
        value: String,
    },
    /// The model has another version than this program.
    #[error(
        "the model has version {found}, but this program requires version {wanted}; train it again"
    )]
    Version {
        /// Version of the model.
        found: u32,
        /// Required version.
        wanted: u32,
    },
    /// The configuration file cannot be parsed.
    #[error("invalid model configuration: {0}")]
    Config(#[from] serde_json::Error),
}

/// A parsed safetensors file.
pub struct Tensors<'a> {
    tensors: SafeTensors<'a>,
    metadata: HashMap<String, String>,
}

impl<'a> Tensors<'a> {
    /// Parses the bytes without copying them.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, WeightsError> {
        let tensors = SafeTensors::deserialize(bytes)?;
        let (_, header) = SafeTensors::read_metadata(bytes)?;
        Ok(Self { tensors, metadata: header.metadata().clone().unwrap_or_default() })
    }

    /// A metadata value of the file's header; `None` if the key is missing.
    pub fn metadata(&self, name: &str) -> Option<&str> {
        self.metadata.get(name).map(String::as_str)
    }

    /// Values of a tensor in half precision, row-major; single precision is rounded to nearest.
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
            self.tensors.tensor(name).map_err(|_| WeightsError::MissingTensor(name.to_owned()))?;
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
            self.tensors.tensor(name).map_err(|_| WeightsError::MissingTensor(name.to_owned()))?;
        Ok(tensor.shape().to_vec())
    }
}
