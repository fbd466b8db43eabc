//! Networks against PyTorch in float64 (`tests/golden/networks.py`): inference, training forward pass and
//! gradients.

use candle_core::{Device, Tensor};
use configs::Gains;
use geometry::Vec3;
use imitation::nn::Params;
use imitation::nn::networks::direct::DirectNetwork;
use imitation::nn::networks::{self, autoencoder};
use imitation::nn::ops::chamfer::Chamfer;
use imitation::train::backward::Loss;
use imitation::train::data_parallel::Gradient;
use imitation::train::expert;
use imitation::train::loss::joint_and_fingertip_error;
use policy::LATENT_DIM;
use policy::encoder::{
    CLOUD_POINTS, DECODER_WIDTHS, Decoder, Encoder, GLOBAL_WIDTHS, LOCAL_WIDTHS, READOUT_WIDTHS,
};
use policy::networks::NetworkConfig;
use policy::networks::acceleration_mlp::{self, AccelerationMlp, AccelerationMlpConfig};
use policy::networks::ngf::{NgfConfig, SUBNETWORKS};
use policy::weights::Tensors;
use policy::{NetworkInput, Ngf, ObservationKind, PolicyConfig, Whitening};
use robot::{DOF, JointState, JointVector, KinematicTree};
use serde_json::Value;

/// Batch size (states).
const BATCH: usize = 4;

/// Error tolerance, relative to the largest value.
const TOLERANCE: f64 = 1e-4;

fn golden(network: &str) -> Value {
    let golden: Value = serde_json::from_str(include_str!("../golden/networks.json")).unwrap();
    golden[network].clone()
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// Pseudo-random multiples of 1/512 in [-1, 1) by name and index, as in the script.
fn pseudo_random(name: &str, count: usize) -> Vec<f32> {
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
        let values = pseudo_random(&weight, inputs * outputs).iter().map(|x| x * scale).collect();
        params.add(&weight, &[inputs, outputs], values).unwrap();
        let values = pseudo_random(&bias, outputs).iter().map(|x| x / 8.0).collect();
        params.add(&bias, &[outputs], values).unwrap();
    }
}

fn assert_close(name: &str, got: &[f64], wanted: &[f64]) {
    assert_eq!(got.len(), wanted.len(), "{name}");
    let size = wanted.iter().map(|x| x.abs()).fold(0.0, f64::max);
    let error = got.iter().zip(wanted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("{name}: max error {:.1e} of the largest value, {size:.3}", error / size);
    assert!(error <= TOLERANCE * size, "{name}: error {error}, largest value {size}");
}

/// Compares the norm and sampled values of the gradient of each parameter.
fn assert_gradients(gradient: &Gradient, params: &Params, wanted: &Value) {
    let mut worst = (0.0f64, "");
    for (name, of_param) in params.names().zip(&gradient.by_param) {
        let wanted = &wanted[name];
        let norm = wanted["norm"].as_f64().unwrap();
        let Some(of_param) = of_param else {
            // A constant offset of the potential has no effect.
            assert_eq!((name, norm), ("potential.3.bias", 0.0));
            continue;
        };
        let flat = of_param.flatten_all().unwrap().to_vec1::<f32>().unwrap();
        let got = flat.iter().map(|g| (*g as f64).powi(2)).sum::<f64>().sqrt();
        // Relative to the norm: small entries need no relative accuracy.
        let mut error = (got - norm).abs() / norm;
        for (at, value) in numbers(&wanted["at"]).iter().zip(numbers(&wanted["values"])) {
            error = error.max((flat[*at as usize] as f64 - value).abs() / norm);
        }
        if error > worst.0 {
            worst = (error, name);
        }
    }
    println!("gradients: max error {:.1e} of the norm, in {}", worst.0, worst.1);
    assert!(worst.0 < TOLERANCE, "gradient of {}: error of {} of its norm", worst.1, worst.0);
}

/// States, the first at rest, and their latents z.
fn batch() -> (Vec<JointState>, Vec<f32>) {
    let (q, mut qd) = (pseudo_random("q", BATCH * DOF), pseudo_random("qd", BATCH * DOF));
    qd[..DOF].fill(0.0);
    let vector = |x: &[f32]| JointVector::from_fn(|i, _| x[i] as f64);
    let states = q.chunks_exact(DOF).zip(qd.chunks_exact(DOF));
    let states = states.map(|(q, qd)| JointState { q: vector(q), qd: vector(qd) }).collect();
    (states, pseudo_random("z", BATCH * LATENT_DIM).iter().map(|x| 2.0 * x).collect())
}

/// Configuration, parameters and training network of the golden policy.
fn ngf() -> (NgfConfig, Params, networks::Network) {
    let config: NgfConfig = serde_json::from_value(golden("policy")["config"].clone()).unwrap();
    let mut params = Params::default();
    SUBNETWORKS.iter().for_each(|part| add_layers(&mut params, part.name, &part.widths(&config)));
    let network = NetworkConfig::Ngf(config.clone());
    let policy = PolicyConfig { observation: ObservationKind::Cloud, network };
    let tree = KinematicTree::iiwa7_allegro().unwrap();
    (config, params, networks::Network::new(&policy, &tree).unwrap())
}

/// Gradient of a weighted sum of the network's accelerations.
fn weighted_sum_gradient(made: &Tensor, params: &Params) -> Gradient {
    let weights = pseudo_random("weights", BATCH * DOF);
    let weights = Tensor::from_vec(weights, (BATCH, DOF), &Device::Cpu).unwrap();
    let loss = (made * weights).unwrap().sum_all().unwrap();
    Gradient::compute(&loss, params).unwrap()
}

#[test]
fn policy_matches_pytorch() {
    let golden = golden("policy");
    let (config, params, twin) = ngf();
    let tree = KinematicTree::iiwa7_allegro().unwrap();
    let (states, z) = batch();
    let latents: Vec<&[f32]> = z.chunks_exact(LATENT_DIM).collect();

    let bytes = params.export(&[]).unwrap();
    let runs = Ngf::load(&Tensors::parse(&bytes).unwrap(), &config, LATENT_DIM, &tree).unwrap();
    let made = twin.forward(&params, &states, &latents).unwrap().accelerations;
    let rows = made.to_vec2::<f32>().unwrap();
    for (i, (state, z)) in states.iter().zip(&latents).enumerate() {
        let wanted = numbers(&golden["qdd"][i]);
        let input = [NetworkInput::new(*state, z)];
        let got = runs.accelerations(&input)[0].unwrap();
        assert_close("acceleration", got.as_slice(), &wanted);
        let trained: Vec<f64> = rows[i].iter().map(|x| *x as f64).collect();
        assert_close("acceleration in training", &trained, &wanted);
        let outputs = runs.outputs(&input);
        let slope: Vec<f64> = outputs[0].potential_gradient.iter().map(|x| *x as f64).collect();
        assert_close("potential gradient", &slope, &numbers(&golden["slope"][i]));
        let potential = [runs.potential(&input[0]) as f64];
        assert_close("potential", &potential, &[golden["potential"][i].as_f64().unwrap()]);
    }
    assert_gradients(&weighted_sum_gradient(&made, &params), &params, &golden["gradients"]);
}

#[test]
fn training_loss_matches_pytorch() {
    let golden = golden("training");
    let settings = |name: &str| golden["settings"][name].as_f64().unwrap();
    let tree = KinematicTree::iiwa7_allegro().unwrap();
    let (_, params, twin) = ngf();
    let (states, z) = batch();
    let latents: Vec<&[f32]> = z.chunks_exact(LATENT_DIM).collect();
    let response = twin.forward(&params, &states, &latents).unwrap();

    let gains = Gains { position: settings("position"), velocity: settings("velocity") };
    let targets = pseudo_random("target", BATCH * DOF);
    let expert_action = |(state, target): (&JointState, &[f32])| {
        let target = JointVector::from_fn(|i, _| target[i] as f64);
        expert::acceleration(&gains, &target, state)
    };
    let wanted: Vec<JointVector> =
        states.iter().zip(targets.chunks_exact(DOF)).map(expert_action).collect();
    let at: Vec<JointVector> = states.iter().map(|state| state.q).collect();
    let (made, weight) = (&response.accelerations, settings("fingertip_weight"));
    let loss = joint_and_fingertip_error(&tree, &at, made, &wanted, weight).unwrap();
    let Loss { reported: shown, total: whole } =
        Loss::with_metric_penalty(loss, &response, settings("metric_weight")).unwrap();
    let shown = [shown.to_scalar::<f32>().unwrap() as f64];
    assert_close("loss", &shown, &[golden["loss"].as_f64().unwrap()]);
    assert_gradients(&Gradient::compute(&whole, &params).unwrap(), &params, &golden["gradients"]);
}

#[test]
fn acceleration_mlps_match_pytorch() {
    let limits = KinematicTree::iiwa7_allegro().unwrap().limits;
    let (states, z) = batch();
    let latents: Vec<&[f32]> = z.chunks_exact(LATENT_DIM).collect();
    for golden in golden("baselines").as_array().unwrap() {
        let config: AccelerationMlpConfig =
            serde_json::from_value(golden["config"].clone()).unwrap();
        let mut params = Params::default();
        add_layers(&mut params, acceleration_mlp::TENSOR_PREFIX, &config.widths(LATENT_DIM));
        let bytes = params.export(&[]).unwrap();
        let tensors = Tensors::parse(&bytes).unwrap();
        let runs = AccelerationMlp::load(&tensors, &config, LATENT_DIM, &limits).unwrap();
        let network = NetworkConfig::Mlp(config);
        let policy = PolicyConfig { observation: ObservationKind::Cloud, network };
        let twin = DirectNetwork::new(&policy, &limits).unwrap();
        let made = twin.accelerations(&params, &states, &latents).unwrap();
        let rows = made.to_vec2::<f32>().unwrap();
        for (i, (state, z)) in states.iter().zip(&latents).enumerate() {
            let wanted = numbers(&golden["qdd"][i]);
            let input = [NetworkInput::new(*state, z)];
            let got = runs.accelerations(&input)[0].unwrap();
            assert_close("acceleration", got.as_slice(), &wanted);
            let trained: Vec<f64> = rows[i].iter().map(|x| *x as f64).collect();
            assert_close("acceleration in training", &trained, &wanted);
        }
        assert_gradients(&weighted_sum_gradient(&made, &params), &params, &golden["gradients"]);
    }
}

#[test]
fn encoder_matches_pytorch() {
    let golden = golden("encoder");
    let mut params = Params::default();
    add_layers(&mut params, "encoder.local", &LOCAL_WIDTHS);
    add_layers(&mut params, "encoder.global", &GLOBAL_WIDTHS);
    add_layers(&mut params, "encoder.readout", &READOUT_WIDTHS);
    add_layers(&mut params, "decoder", &DECODER_WIDTHS);
    let center = Vec3::new(0.625, 0.0, -0.125);
    let cloud: Vec<Vec3> = pseudo_random("cloud", 3 * CLOUD_POINTS)
        .chunks_exact(3)
        .map(|p| center + Vec3::new(p[0], p[1], p[2]) / 8.0)
        .collect();
    let flat = cloud.iter().flat_map(|p| p.to_array()).collect::<Vec<f32>>();

    let bytes = params.export(&Whitening::identity().tensors()).unwrap();
    let tensors = Tensors::parse(&bytes).unwrap();
    let z = Encoder::load(&tensors).unwrap().encode_unwhitened(&cloud).unwrap();
    let wanted = numbers(&golden["z"]);
    assert_close("z", &z.iter().map(|z| *z as f64).collect::<Vec<_>>(), &wanted);
    let decoded = Decoder::load(&tensors).unwrap().decode(&z);
    let decoded = decoded.into_iter().flat_map(policy::encoder::normalized_position);
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
    assert_gradients(&Gradient::compute(&loss, &params).unwrap(), &params, &golden["gradients"]);
}
