use std::sync::Arc;
use render::{scene::*, volume::*, gpu::Gpu, renderer::*, reference};
fn scene(texture: TextureFormat) -> Scene {
    let raw = std::fs::read("/tmp/dev/cranium.raw").unwrap();
    let v: Vec<i16> = raw.chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect();
    let w = Affine::from_columns(Vector::x()*0.957, Vector::y()*-0.957, Vector::z()*1.5, Point::new(-122.0, 122.0, -80.0)).unwrap();
    let grid = Arc::new(Grid::new([256,256,108], Samples::I16(v), Rescale::default(), w).unwrap());
    let p = |value, r, g, b, a| ControlPoint { value, rgba: [r,g,b,a] };
    let t = Arc::new(Transfer::new(vec![p(-1024.0,0.0,0.0,0.0,0.0), p(-50.0,0.8,0.4,0.3,0.0), p(60.0,0.8,0.4,0.3,0.01),p(150.0,0.8,0.5,0.3,0.02),p(300.0,0.85,0.6,0.4,0.25), p(1200.0,1.0,0.95,0.85,0.8)], 1.0).unwrap());
    Scene { volumes: vec![VolumeItem{grid, pose: Affine::identity(), transfer: t, shading: Shading::None, texture, pieces: vec![Piece::whole()]}], meshes: vec![],
        camera: Camera{eye: Point::new(250.0,-400.0,120.0), target: Point::origin(), up: Vector::z(), projection: Projection::Perspective{fov_rad: 0.5}}, background: [0.0;3]}
}
#[test]
fn probe() {
    let gpu = Arc::new(Gpu::headless().unwrap());
    let mut r = Renderer::new(gpu).unwrap();
    for cut in [2] {
    let mut s = scene(TextureFormat::R16);
    if cut >= 1 {
        let a = Cutter::plane(Point::new(0.0,0.0,10.0), Vector::new(0.3,0.2,1.0)).unwrap();
        let b = Cutter::plane(Point::new(10.0,0.0,0.0), Vector::new(1.0,0.2,-0.3)).unwrap();
        s.volumes[0].pieces = vec![Piece{keep: vec![(a,Side::Plus)], pose: if cut == 2 {Affine::rotation_about(Point::origin(), Vector::x(), 0.2)*Affine::translation(Vector::new(5.0,-3.0,20.0))} else {Affine::identity()}},
          Piece{keep: vec![(a,Side::Minus),(b,Side::Plus)], pose: Affine::identity()},
          Piece{keep: vec![(a,Side::Minus),(b,Side::Minus)], pose: Affine::identity()}];
    }
    if cut == 2 {
        let m = |c: Vector, q: f64| { let p: Vec<Point> = (0..8).map(|i| Point::from(c + Vector::new(if i&1>0 {q} else {-q}, if i&2>0 {q} else {-q}, if i&4>0 {q} else {-q}))).collect();
          let f = [[0,4,6,2],[1,3,7,5],[0,1,5,4],[2,6,7,3],[0,2,3,1],[4,5,7,6]];
          Arc::new(TriangleMesh::new(p, f.iter().flat_map(|f| [[f[0],f[1],f[2]],[f[0],f[2],f[3]]]).collect()).unwrap()) };
        s.meshes = vec![MeshItem{mesh: m(Vector::new(10.0,-90.0,0.0), 40.0), pose: Affine::rotation_about(Point::origin(), Vector::new(1.0,1.0,0.3), 0.5), color: [0.2,0.6,1.0], opacity: 0.4, shading: Shading::Lit},
          MeshItem{mesh: m(Vector::new(60.0,-60.0,60.0), 20.0), pose: Affine::rotation_about(Point::origin(), Vector::new(1.0,1.0,0.3), 0.1), color: [0.2,1.0,0.2], opacity: 1.0, shading: Shading::Lit}];
    }
    let t = std::time::Instant::now();
    let truth = reference::draw(&s, [256,256], &Default::default(), &|_,_| true).unwrap();
    println!("cut {cut} reference {:?}", t.elapsed());
    image::save_buffer(format!("/tmp/dev/ref{cut}.png"), &truth.to_rgb8([0.0;3]), 256, 256, image::ExtendedColorType::Rgb8).unwrap();
    for q in [0.25] {
        r.render(&s, [256,256], Quality::Spacing(q)).unwrap();
        let st = r.render(&s, [256,256], Quality::Spacing(q)).unwrap();
        let img = r.read().unwrap();
        let d = img.difference(&truth, [0.0;3]).unwrap();
        println!("q {q}: {:?} frame {:.1} prep {:.1} draws {} overl {} layers {} looks {}", d, st.frame_ms, st.prepare_ms, st.draws, st.most_overlapping, st.layers, st.saturate_looks);
        if q == 0.25 { image::save_buffer(format!("/tmp/dev/gpu{cut}.png"), &img.to_rgb8([0.0;3]), 256, 256, image::ExtendedColorType::Rgb8).unwrap(); 
          let mut worst = (0.0f32,0); for (i,(a,b)) in img.pixels.iter().zip(&truth.pixels).enumerate() { for c in 0..3 { let e=(a[c]-b[c]).abs(); if e>worst.0 {worst=(e,i);} } } let mut n=0; for (i,(a,b)) in img.pixels.iter().zip(&truth.pixels).enumerate() { let e=(0..3).map(|c| (a[c]-b[c]).abs()).fold(0.0,f32::max)*255.0; if e>4.0 { n+=1; if n<25 { println!("worst px {},{} {e:.1} {:?} {:?}", i%256, i/256, a, b); } } } println!("worst n {n}");
          println!("worst {:?} at {},{} {:?} {:?}", worst.0*255.0, worst.1%256, worst.1/256, img.pixels[worst.1], truth.pixels[worst.1]); }
    }
    }
}
#[test]
fn meshes_only() {
    let gpu = Arc::new(Gpu::headless().unwrap());
    let mut r = Renderer::new(gpu).unwrap();
    let mut s = scene(TextureFormat::R16);
    let m = |c: Vector, q: f64| { let p: Vec<Point> = (0..8).map(|i| Point::from(c + Vector::new(if i&1>0 {q} else {-q}, if i&2>0 {q} else {-q}, if i&4>0 {q} else {-q}))).collect();
          let f = [[0,4,6,2],[1,3,7,5],[0,1,5,4],[2,6,7,3],[0,2,3,1],[4,5,7,6]];
          Arc::new(TriangleMesh::new(p, f.iter().flat_map(|f| [[f[0],f[1],f[2]],[f[0],f[2],f[3]]]).collect()).unwrap()) };
    let a = MeshItem{mesh: m(Vector::new(10.0,-90.0,0.0), 40.0), pose: Affine::rotation_about(Point::origin(), Vector::new(1.0,1.0,0.3), 0.5), color: [0.2,0.6,1.0], opacity: 0.4, shading: Shading::None};
    let b = MeshItem{mesh: m(Vector::new(60.0,-60.0,60.0), 20.0), pose: Affine::rotation_about(Point::origin(), Vector::new(1.0,1.0,0.3), 0.1), color: [0.2,1.0,0.2], opacity: 1.0, shading: Shading::None};
    let vols = std::mem::take(&mut s.volumes);
    for (name, meshes, v) in [("translucent", vec![a.clone()], false), ("opaque", vec![b.clone()], false), ("both", vec![a.clone(), b.clone()], false), ("vol+opaque", vec![b.clone()], true), ("vol+transl", vec![a.clone()], true)] {
        s.meshes = meshes;
        s.volumes = if v { vols.clone() } else { vec![] };
        let truth = reference::draw(&s, [64,64], &Default::default(), &|_,_| true).unwrap();
        let st = r.render(&s, [64,64], Quality::Good).unwrap();
        let img = r.read().unwrap();
        for (k, im) in [("g",&img),("r",&truth)] { image::save_buffer(format!("/tmp/dev/m_{name}_{k}.png"), &im.to_rgb8([0.0;3]), 64, 64, image::ExtendedColorType::Rgb8).unwrap(); }
        println!("q {name}: {:?} {:.1} ms layers {}", img.difference(&truth, [0.0;3]).unwrap(), st.frame_ms, st.layers);
    }
}
