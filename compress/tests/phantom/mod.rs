//! A volume that codecs meet in practice, made by code: a trunk with fat, muscle, a bone with cortex and marrow, a
//! bowel with gas, all blurred by a scanner and covered by its noise; and its pre-classified colours.

use compress::Extent3;

/// Noise of an abdominal scan, as a standard deviation in HU.
const NOISE_HU: f64 = 15.0;

/// The HU of a volume of `extent`, `[x, y, z]`, x fastest.
pub(crate) fn hounsfield(extent: Extent3) -> Vec<f64> {
    let [width, height, _] = extent.sizes().map(f64::from);
    let mut noise = Noise(0x9E37_79B9_7F4A_7C15);
    let mut hu = Vec::with_capacity(extent.voxels());
    for z in 0..extent.z() {
        for y in 0..extent.y() {
            for x in 0..extent.x() {
                let (u, v, w) = (x as f64 / width - 0.5, y as f64 / height - 0.5, z as f64 / 64.0);
                let radius = |cx: f64, cy: f64, rx: f64, ry: f64| ((u - cx) / rx).hypot((v - cy) / ry);
                let mut value = -1000.0;
                // Each organ covers what was there by a step blurred over some voxels.
                let mut cover = |inside: f64, hu: f64, size: f64| {
                    let share = 1.0 / (1.0 + (-inside * size * width / 0.7).exp());
                    value += (hu - value) * share;
                };
                cover(1.0 - radius(0.0, 0.0, 0.47, 0.42), -90.0, 0.45);
                cover(1.0 - radius(0.0, 0.0, 0.42, 0.36), 55.0, 0.4);
                cover(1.0 - radius(-0.16, 0.05 + 0.1 * w, 0.10, 0.08), 30.0, 0.1);
                cover(1.0 - radius(0.15, -0.08, 0.12, 0.11), 1250.0, 0.12);
                cover(1.0 - radius(0.15, -0.08, 0.085, 0.075), 260.0, 0.08);
                cover(1.0 - radius(0.15, -0.08, 0.04, 0.035), -20.0, 0.04);
                cover(1.0 - radius(-0.1, -0.2 + 0.1 * w, 0.06, 0.05), -950.0, 0.06);
                // Trabeculae of the cancellous bone.
                let trabecula =
                    (x as f64 * 0.9 + y as f64 * 0.35).sin() * (y as f64 * 0.8 - z as f64 * 0.6).sin();
                let in_bone = (1.0 - radius(0.15, -0.08, 0.085, 0.075)).clamp(0.0, 0.5) * 2.0;
                hu.push(value + 130.0 * trabecula * in_bone + NOISE_HU * noise.gaussian());
            }
        }
    }
    hu
}

/// HU from -1024 to 3071 as 8 bits.
pub(crate) fn scalar(hounsfield: &[f64]) -> Vec<u8> {
    hounsfield.iter().map(|hu| ((hu + 1024.0) / 4095.0 * 255.0).round().clamp(0.0, 255.0) as u8).collect()
}

/// HU as pre-classified colour and opacity, 4 bytes a voxel.
pub(crate) fn colour(hounsfield: &[f64]) -> Vec<u8> {
    const POINTS: [(f64, [f64; 4]); 6] = [
        (-1024.0, [0.0, 0.0, 0.0, 0.0]),
        (-400.0, [0.2, 0.1, 0.1, 0.0]),
        (0.0, [0.75, 0.4, 0.3, 0.05]),
        (300.0, [0.85, 0.6, 0.4, 0.25]),
        (1000.0, [1.0, 0.95, 0.85, 0.8]),
        (3071.0, [1.0; 4]),
    ];
    let classify = |&hu: &f64| {
        let after = POINTS.iter().position(|(at, _)| *at > hu).unwrap_or(POINTS.len() - 1).max(1);
        let ((from, a), (to, b)) = (POINTS[after - 1], POINTS[after]);
        let t = ((hu - from) / (to - from)).clamp(0.0, 1.0);
        [0, 1, 2, 3].map(|c: usize| ((a[c] + (b[c] - a[c]) * t) * 255.0).round() as u8)
    };
    hounsfield.iter().flat_map(classify).collect()
}

/// Random numbers that are the same on every machine (`SplitMix64`).
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    pub(crate) fn bytes(&mut self, len: usize) -> Vec<u8> {
        (0..len).map(|_| self.bits() as u8).collect()
    }

    /// Mean 0, standard deviation 1: the sum of twelve uniform numbers.
    fn gaussian(&mut self) -> f64 {
        (0..12).map(|_| (self.bits() >> 11) as f64 / (1_u64 << 53) as f64).sum::<f64>() - 6.0
    }
}
