#![allow(warnings)]
use compress::bc::{EncodeOptions, Level};
use compress::texture::*;
use compress::*;
use std::time::Instant;
fn main(){
    let a: Vec<String>=std::env::args().collect();
    let bytes=std::fs::read(&a[1]).unwrap();
    let s: Vec<i16>=bytes.as_chunks::<2>().0.iter().map(|b| i16::from_le_bytes(*b)).collect();
    let stem=a[1].rsplit('/').next().unwrap().rsplit_once('.').unwrap().0.rsplit_once('_').unwrap().1;
    let d:Vec<u32>=stem.split('x').map(|n|n.parse().unwrap()).collect();
    let e=Extent3::new([d[0],d[1],d[2]]).unwrap();
    let bone: Vec<[f64;5]> = vec![[-1024.0, 0.40, 0.20, 0.12, 0.0],[160.0, 0.52, 0.30, 0.18, 0.0],[240.0, 0.72, 0.47, 0.30, 0.10],[420.0, 0.87, 0.68, 0.47, 0.42],[750.0, 0.95, 0.86, 0.70, 0.80],[1300.0, 0.99, 0.96, 0.88, 0.94],[3071.0, 1.0, 1.0, 1.0, 0.97]];
    let soft=vec![[-1024.0, 0.0, 0.0, 0.0, 0.0],[-180.0, 0.88, 0.74, 0.42, 0.0],[-105.0, 0.93, 0.80, 0.48, 0.006],[-30.0, 0.80, 0.48, 0.34, 0.006],[55.0, 0.70, 0.24, 0.18, 0.035],[160.0, 0.80, 0.46, 0.34, 0.06],[400.0, 0.95, 0.86, 0.70, 0.35],[3071.0, 1.0, 1.0, 1.0, 0.90]];
    let clear=vec![[-1024.0, 0.0, 0.0, 0.0, 0.0],[3071.0, 1.0, 1.0, 1.0, 0.0]];
    let muscle=vec![[-1024.0, 0.0, 0.0, 0.0, 0.0],[-25.0, 0.45, 0.10, 0.08, 0.0],[25.0, 0.60, 0.18, 0.14, 0.20],[90.0, 0.74, 0.28, 0.22, 0.55],[180.0, 0.82, 0.52, 0.40, 0.60],[500.0, 0.95, 0.88, 0.74, 0.85],[3071.0, 1.0, 1.0, 1.0, 0.95]];
    let p=match a[2].as_str(){"bone"=>bone,"soft"=>soft,"muscle"=>muscle,_=>clear};
    let p:Vec<ColourPoint>=p.iter().map(|p|ColourPoint{value:p[0],rgba:[p[1],p[2],p[3],p[4]]}).collect();
    let t=ColourTable::new(&p,SampleKind::I16,0.0).unwrap();
    let src=Source::new(Volume::new(Samples::I16(&s),e).unwrap(),Mapping::Colours(&t)).unwrap();
    let mut out=vec![0u8;BlockFormat::Bc3.encoded_len(e)];
    let mut tex=vec![0u8;e.voxels()*4];
    let n:usize=a[3].parse().unwrap();
    let pool=rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let (mut a1,mut a2)=(1e9f64,1e9f64);
    let mut st=EncodeStats::default();
    pool.install(||{
    for _ in 0..n{
        let b=Instant::now(); st=src.blocks_into(BlockFormat::Bc3,EncodeOptions::default().with_level(Level::Fast),&mut out).unwrap(); a1=a1.min(b.elapsed().as_secs_f64());
        if a.len()<=4 {
        let b=Instant::now(); src.texels_into(TexelFormat::Rgba8,&mut tex).unwrap(); a2=a2.min(b.elapsed().as_secs_f64());}
    }});
    let l=src.loss_of_blocks(BlockFormat::Bc3,&out).unwrap(); print!("psnr {:.2} max {:.1} ",l.psnr_db(255.0),l.largest);
    println!("fast {:.3} ms  plain {:.3} ms ratio {:.3} {st:?}",a1*1e3,a2*1e3,a1/a2);
}
