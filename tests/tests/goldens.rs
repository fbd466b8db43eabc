//! The networks against PyTorch in float64 (`tests/golden/networks.py`): what runs, what trains, and the
//! gradients of what trains.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use candle_core::{Device, Tensor};
use geometry::Vec3;
use imitation::expert::{self, Gains};
use imitation::loss::joint_and_tip_error;
use imitation::nn::{self, Params, autoencoder, chamfer::Chamfer};
use imitation::shards::Gradient;
use imitation::step::Loss;
use policy::baseline::{self, Baseline, BaselineConfig};
use policy::encoder::{
    CLOUD, DECODER_WIDTHS, Decoder, Encoder, GLOBAL_WIDTHS, LATENT, LOCAL_WIDTHS, READOUT_WIDTHS,
};
use policy::network::NetworkConfig;
use policy::ngf::{NgfConfig, PARTS};
use policy::weights::Tensors;
use policy::{Ngf, Observation, PolicyConfig, Whitening};
use robot::{DOF, JointState, JointVector, Tree};
use serde_json::Value;

/// States in a batch.
const BATCH: usize = 4;

/// Relative to the largest value.
const TOLERANCE: f64 = 1e-4;

fn golden(of: &str) -> Value {
    let golden: Value = serde_json::from_str(include_str!("../golden/networks.json")).unwrap();
    golden[of].clone()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Multiples of 1/512 in [-1, 1), by name and index; as in the script.
fn hashed(name: &str, count: usize) -> Vec<f32> {
    let seed = crc32(name.as_bytes()) as u64;
    let hash = |k: u64| {
        let h = (k * 2_654_435_761 + seed) & 0xFFFF_FFFF;
        let h = ((h ^ (h >> 15)) * 2_246_822_519) & 0xFFFF_FFFF;
        ((h >> 22) as f32 - 512.0) / 512.0
    };
    (0..count as u64).map(hash).collect()
}

fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32, _| if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, byte| (0..8).fold(crc ^ *byte as u32, step))
}

fn add_layers(params: &mut Params, name: &str, widths: &[usize]) {
    for (i, pair) in widths.windows(2).enumerate() {
        let (inputs, outputs) = (pair[0], pair[1]);
        let scale = (3.0 / inputs as f64).sqrt().log2().ceil().exp2() as f32;
        let (weight, bias) = (format!("{name}.{i}.weight"), format!("{name}.{i}.bias"));
        let values = hashed(&weight, inputs * outputs).iter().map(|x| x * scale).collect();
        params.add(&weight, &[inputs, outputs], values).unwrap();
        let values = hashed(&bias, outputs).iter().map(|x| x / 8.0).collect();
        params.add(&bias, &[outputs], values).unwrap();
    }
}

fn assert_close(what: &str, got: &[f64], wanted: &[f64]) {
    assert_eq!(got.len(), wanted.len(), "{what}");
    let size = wanted.iter().map(|x| x.abs()).fold(0.0, f64::max);
    let off = got.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("{what}: within {:.1e} of the largest value, {size:.3}", off / size);
    assert!(off <= TOLERANCE * size, "{what}: off by {off} of {size}");
}

/// Norm and a few values of the gradient of each parameter.
fn assert_gradients(gradient: &Gradient, params: &Params, wanted: &Value) {
    let mut worst = (0.0f64, "");
    for (name, of_param) in params.names().zip(&gradient.of_params) {
        let wanted = &wanted[name];
        let norm = wanted["norm"].as_f64().unwrap();
        let Some(of_param) = of_param else {
            // Of a potential only the slope matters, not the height.
            assert_eq!((name, norm), ("potential.3.bias", 0.0));
            continue;
        };
        let flat = of_param.flatten_all().unwrap().to_vec1::<f32>().unwrap();
        let got = flat.iter().map(|g| (*g as f64).powi(2)).sum::<f64>().sqrt();
        // Relative to the norm: what is small among the entries need not be relatively exact.
        let mut off = (got - norm).abs() / norm;
        for (at, value) in numbers(&wanted["at"]).iter().zip(numbers(&wanted["values"])) {
            off = off.max((flat[*at as usize] as f64 - value).abs() / norm);
        }
        if off > worst.0 {
            worst = (off, name);
        }
    }
    println!("gradients: within {:.1e} of the norm, at worst in {}", worst.0, worst.1);
    assert!(worst.0 < TOLERANCE, "the gradient of {} is off by {} of its norm", worst.1, worst.0);
}

/// States, the first one at rest, and what is told of their objects.
fn batch() -> (Vec<JointState>, Vec<f32>) {
    let (q, mut qd) = (hashed("q", BATCH * DOF), hashed("qd", BATCH * DOF));
    qd[..DOF].fill(0.0);
    let vector = |x: &[f32]| JointVector::from_fn(|i, _| x[i] as f64);
    let states = q.chunks_exact(DOF).zip(qd.chunks_exact(DOF));
    let states = states.map(|(q, qd)| JointState { q: vector(q), qd: vector(qd) }).collect();
    (states, hashed("z", BATCH * LATENT).iter().map(|x| 2.0 * x).collect())
}

/// The fabric of the golden, with its parameters.
fn ngf() -> (NgfConfig, Params, nn::network::Network) {
    let config: NgfConfig = serde_json::from_value(golden("policy")["config"].clone()).unwrap();
    let mut params = Params::default();
    PARTS.iter().for_each(|part| add_layers(&mut params, part.name, &part.widths(&config)));
    let network = NetworkConfig::Ngf(config.clone());
    let policy = PolicyConfig { observation: Observation::Cloud, network };
    let limits = Tree::iiwa7_allegro().unwrap().limits;
    (config, params, nn::network::Network::new(&policy, &limits).unwrap())
}

/// Gradient of the weighted sum of what a network does.
fn weighted(made: &Tensor, params: &Params) -> Gradient {
    let weights = hashed("weights", BATCH * DOF);
    let weights = Tensor::from_vec(weights, (BATCH, DOF), &Device::Cpu).unwrap();
    let loss = (made * weights).unwrap().sum_all().unwrap();
    Gradient::of(&loss, params).unwrap()
}

#[test]
fn the_policy_is_that_of_pytorch() {
    let golden = golden("policy");
    let (config, params, twin) = ngf();
    let limits = Tree::iiwa7_allegro().unwrap().limits;
    let (states, z) = batch();
    let latents: Vec<&[f32]> = z.chunks_exact(LATENT).collect();

    let bytes = params.export(&[]).unwrap();
    let runs = Ngf::load(&Tensors::parse(&bytes).unwrap(), &config, LATENT, &limits).unwrap();
    let made = twin.respond(&params, &states, &latents).unwrap().accelerations;
    let rows = made.to_vec2::<f32>().unwrap();
    for (i, (state, z)) in states.iter().zip(&latents).enumerate() {
        let wanted = numbers(&golden["qdd"][i]);
        let got = runs.acceleration(state, z).unwrap();
        assert_close("acceleration", got.as_slice(), &wanted);
        let trained: Vec<f64> = rows[i].iter().map(|x| *x as f64).collect();
        assert_close("acceleration in training", &trained, &wanted);
        let slope = runs.outputs(state, z).potential_gradient;
        let slope: Vec<f64> = slope.iter().map(|x| *x as f64).collect();
        assert_close("slope of the potential", &slope, &numbers(&golden["slope"][i]));
        let potential = [runs.potential(state, z) as f64];
        assert_close("potential", &potential, &[golden["potential"][i].as_f64().unwrap()]);
    }
    assert_gradients(&weighted(&made, &params), &params, &golden["gradients"]);
}

#[test]
fn what_a_policy_learns_from_is_that_of_pytorch() {
    let golden = golden("training");
    let settings = |name: &str| golden["settings"][name].as_f64().unwrap();
    let tree = Tree::iiwa7_allegro().unwrap();
    let (_, params, twin) = ngf();
    let (states, z) = batch();
    let latents: Vec<&[f32]> = z.chunks_exact(LATENT).collect();
    let response = twin.respond(&params, &states, &latents).unwrap();

    let gains = Gains { position: settings("position"), velocity: settings("velocity") };
    let targets = hashed("target", BATCH * DOF);
    let advice = |(state, target): (&JointState, &[f32])| {
        let target = JointVector::from_fn(|i, _| target[i] as f64);
        expert::acceleration(&gains, &target, state)
    };
    let wanted: Vec<JointVector> =
        states.iter().zip(targets.chunks_exact(DOF)).map(advice).collect();
    let at: Vec<JointVector> = states.iter().map(|state| state.q).collect();
    let (made, weight) = (&response.accelerations, settings("tip_weight"));
    let loss = joint_and_tip_error(&tree, &at, made, &wanted, weight).unwrap();
    let Loss { shown, whole } =
        Loss::with_metrics(loss, &response, settings("metric_weight")).unwrap();
    let shown = [shown.to_scalar::<f32>().unwrap() as f64];
    assert_close("loss", &shown, &[golden["loss"].as_f64().unwrap()]);
    assert_gradients(&Gradient::of(&whole, &params).unwrap(), &params, &golden["gradients"]);
}

#[test]
fn the_baselines_are_those_of_pytorch() {
    let limits = Tree::iiwa7_allegro().unwrap().limits;
    let (states, z) = batch();
    let latents: Vec<&[f32]> = z.chunks_exact(LATENT).collect();
    for golden in golden("baselines").as_array().unwrap() {
        let config: BaselineConfig = serde_json::from_value(golden["config"].clone()).unwrap();
        let mut params = Params::default();
        add_layers(&mut params, baseline::NAME, &config.widths(LATENT));
        let bytes = params.export(&[]).unwrap();
        let tensors = Tensors::parse(&bytes).unwrap();
        let runs = Baseline::load(&tensors, &config, LATENT, &limits).unwrap();
        let twin = nn::baseline::Baseline::new(&config, LATENT, &limits).unwrap();
        let made = twin.accelerations(&params, &states, &latents).unwrap();
        let rows = made.to_vec2::<f32>().unwrap();
        for (i, (state, z)) in states.iter().zip(&latents).enumerate() {
            let wanted = numbers(&golden["qdd"][i]);
            let got = runs.acceleration(state, z).unwrap();
            assert_close("acceleration", got.as_slice(), &wanted);
            let trained: Vec<f64> = rows[i].iter().map(|x| *x as f64).collect();
            assert_close("acceleration in training", &trained, &wanted);
        }
        assert_gradients(&weighted(&made, &params), &params, &golden["gradients"]);
    }
}

#[test]
fn the_encoder_is_that_of_pytorch() {
    let golden = golden("encoder");
    let mut params = Params::default();
    add_layers(&mut params, "encoder.local", &LOCAL_WIDTHS);
    add_layers(&mut params, "encoder.global", &GLOBAL_WIDTHS);
    add_layers(&mut params, "encoder.readout", &READOUT_WIDTHS);
    add_layers(&mut params, "decoder", &DECODER_WIDTHS);
    let middle = Vec3::new(0.625, 0.0, -0.125);
    let cloud: Vec<Vec3> = hashed("cloud", 3 * CLOUD)
        .chunks_exact(3)
        .map(|p| middle + Vec3::new(p[0], p[1], p[2]) / 8.0)
        .collect();
    let flat = cloud.iter().flat_map(|p| p.to_array()).collect::<Vec<f32>>();

    let bytes = params.export(&Whitening::identity().tensors()).unwrap();
    let tensors = Tensors::parse(&bytes).unwrap();
    let z = Encoder::load(&tensors).unwrap().raw(&cloud).unwrap();
    let wanted = numbers(&golden["z"]);
    assert_close("z", &z.iter().map(|z| *z as f64).collect::<Vec<_>>(), &wanted);
    let decoded = Decoder::load(&tensors).unwrap().decode(&z);
    let decoded = decoded.into_iter().flat_map(policy::encoder::global_position);
    let sample: Vec<f64> = decoded.step_by(21).map(|x| x as f64).collect();
    assert_close("decoded cloud", &sample, &numbers(&golden["decoded"]));

    let trained = autoencoder::encode(&params, &[&flat]).unwrap();
    let row: Vec<f64> = trained.to_vec2::<f32>().unwrap()[0].iter().map(|z| *z as f64).collect();
    assert_close("z in training", &row, &wanted);
    let made = autoencoder::decode(&params, &trained).unwrap();
    let targets = autoencoder::targets(&[&flat]).unwrap();
    let loss = made.apply_op2(&targets, Chamfer::default()).unwrap().sum_all().unwrap();
    let chamfer = [loss.to_scalar::<f32>().unwrap() as f64];
    assert_close("chamfer", &chamfer, &[golden["chamfer"].as_f64().unwrap()]);
    assert_gradients(&Gradient::of(&loss, &params).unwrap(), &params, &golden["gradients"]);
}
