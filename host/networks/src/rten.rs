//! Networks on rten, an ONNX runtime in Rust.

use rten::{Dimension, Model, NodeId, Value, ValueOrView};
use rten_tensor::{AsView as _, Layout as _};
use vergence_matching::learned::{Elements, Network, NetworkError, Outlet, Signature, Tensor};

struct Rten {
    model: Model,
    signature: Signature,
}

/// Loads a network from the bytes of an ONNX file with rten; `name` appears in messages.
///
/// # Errors
/// [`NetworkError::Load`] where rten does not support the file.
pub fn load_rten(name: &str, bytes: &[u8]) -> Result<Box<dyn Network>, NetworkError> {
    let failed = |error: &dyn std::fmt::Display| NetworkError::Load { network: name.into(), reason: error.to_string() };
    let model = Model::load(bytes.to_vec()).map_err(|error| failed(&error))?;
    let outlets = |ids: &[NodeId]| ids.iter().filter_map(|&id| outlet(&model, id)).collect();
    let signature = Signature { inputs: outlets(model.input_ids()), outputs: outlets(model.output_ids()) };
    Ok(Box::new(Rten { model, signature }))
}

fn outlet(model: &Model, id: NodeId) -> Option<Outlet> {
    let info = model.node_info(id)?;
    let extent = |dimension: &Dimension| match dimension {
        Dimension::Fixed(extent) => Some(*extent),
        Dimension::Symbolic(_) => None,
    };
    let shape = info.shape().map(|dimensions| dimensions.iter().map(extent).collect());
    Some(Outlet { name: info.name()?.into(), shape })
}

impl Network for Rten {
    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn run(&self, inputs: Vec<(&str, Tensor)>, outputs: &[&str]) -> Result<Vec<Tensor>, NetworkError> {
        let mut values: Vec<(NodeId, ValueOrView<'_>)> = Vec::with_capacity(inputs.len());
        for (name, tensor) in inputs {
            values.push((self.model.node_id(name).map_err(|error| failed(&error))?, value(tensor)?.into()));
        }
        let wanted: Result<Vec<NodeId>, _> = outputs.iter().map(|name| self.model.node_id(name)).collect();
        let wanted = wanted.map_err(|error| failed(&error))?;
        let given = self.model.run(values, &wanted, None).map_err(|error| failed(&error))?;
        given.into_iter().map(tensor).collect()
    }
}

fn value(tensor: Tensor) -> Result<Value, NetworkError> {
    match tensor.data {
        Elements::Float(data) => Value::from_shape(&tensor.shape, data).map_err(|error| failed(&error)),
        Elements::Integer(data) => {
            // rten computes with 32-bit integers; its own loader narrows in the same way.
            let narrow: Result<Vec<i32>, _> = data.into_iter().map(i32::try_from).collect();
            let narrow = narrow.map_err(|error| failed(&error))?;
            Value::from_shape(&tensor.shape, narrow).map_err(|error| failed(&error))
        }
    }
}

fn tensor(value: Value) -> Result<Tensor, NetworkError> {
    match value {
        Value::FloatTensor(values) => {
            Ok(Tensor { shape: values.shape().to_vec(), data: Elements::Float(values.to_vec()) })
        }
        Value::Int32Tensor(values) => {
            let wide = values.to_vec().into_iter().map(i64::from).collect();
            Ok(Tensor { shape: values.shape().to_vec(), data: Elements::Integer(wide) })
        }
        _ => Err(NetworkError::Run("an output is neither floats nor integers".into())),
    }
}

fn failed(error: &dyn std::fmt::Display) -> NetworkError {
    NetworkError::Run(error.to_string())
}
