//! Rays as the rows of a NumPy array, answers as records of one.

use super::npy::{self, Float, Header};
use super::stream::{self, Items, Stop, Stream};
use crate::cli::exit::{Exit, Failure};
use glam::{DVec2, DVec3};
use std::io;
use tison::probe::{Answer, ProbeRay, Prober};

/// The fields of a record, packed. A miss has `t` infinite, ids of -1 and otherwise NaN.
const RECORD: &str = "[('hit', '|b1'), ('t', '<f8'), ('p', '<f8', (3,)), ('n', '<f8', (3,)), ('ng', '<f8', (3,)), \
                      ('uv', '<f8', (2,)), ('object', '<i8'), ('prim', '<i8'), ('entering', '|b1')]";

/// Answers the array on stdin.
pub fn answer(prober: &Prober, stream: &mut Stream<'_>) -> Result<(), Failure> {
    let header = loop {
        match npy::header(stream.pending()).map_err(|what| Failure::new(Exit::Input, format!("stdin: {what}")))? {
            Some(header) => break header,
            // A signal may have ended it as well, and then nobody is told.
            None if stream.is_over() && stream.pending().is_empty() => return Ok(()),
            None if stream.is_over() => return Err(Failure::new(Exit::Input, "stdin: it ends within the header")),
            None => stream.wait()?,
        }
    };
    stream.skip(header.bytes);
    let mut out = io::stdout().lock();
    if !stream::write(&mut out, &npy::written(RECORD, header.rows))? || !stream::flush(&mut out)? {
        return Ok(());
    }
    drop(out);
    stream.answer(&Rows { prober, header })
}

struct Rows<'a> {
    prober: &'a Prober,
    header: Header,
}

impl Rows<'_> {
    /// Bytes of a row.
    fn size(&self) -> usize {
        self.header.columns * self.header.float.size()
    }

    fn ray(&self, row: &[u8]) -> Result<ProbeRay, String> {
        let mut values = [0.0; 8];
        values[7] = f64::INFINITY;
        for (value, bytes) in values.iter_mut().zip(row.chunks_exact(self.header.float.size())) {
            *value = number(self.header.float, bytes);
        }
        let [ox, oy, oz, dx, dy, dz, t_min, t_max] = values;
        let ray = ProbeRay { o: DVec3::new(ox, oy, oz), d: DVec3::new(dx, dy, dz), t_min, t_max };
        let fault = |what: &str| format!("{what}: {:?}", &values[..self.header.columns]);
        if !(ray.o.is_finite() && ray.d.is_finite()) || t_min.is_nan() || t_max.is_nan() {
            return Err(fault("a number that is not finite"));
        }
        if ray.d == DVec3::ZERO {
            return Err(fault("a direction of length 0"));
        }
        Ok(ray)
    }
}

fn number(float: Float, bytes: &[u8]) -> f64 {
    match float {
        Float::F4 => f64::from(f32::from_le_bytes(bytes.try_into().expect("four bytes"))),
        Float::F8 => f64::from_le_bytes(bytes.try_into().expect("eight bytes")),
    }
}

impl Items for Rows<'_> {
    fn whole(&self, pending: &[u8], before: u64, _: bool) -> Result<usize, Failure> {
        let left = usize::try_from(self.header.rows - before).unwrap_or(usize::MAX);
        Ok((pending.len() / self.size()).min(left) * self.size())
    }

    fn cut(&self, bytes: &[u8], size: usize) -> usize {
        (size / self.size() * self.size()).min(bytes.len())
    }

    fn count(&self, bytes: &[u8]) -> u64 {
        (bytes.len() / self.size()) as u64
    }

    fn is_done(&self, before: u64) -> bool {
        before == self.header.rows
    }

    fn end(&self, before: u64) -> Result<(), Failure> {
        if self.is_done(before) {
            return Ok(());
        }
        let what = format!("stdin: it ends after {before} whole rows of {}", self.header.rows);
        Err(Failure::new(Exit::Input, what))
    }

    fn answer(&self, part: &[u8], out: &mut Vec<u8>) -> Result<(), Stop> {
        for (index, row) in part.chunks_exact(self.size()).enumerate() {
            match self.ray(row) {
                Ok(ray) => write(self.prober.probe(&ray).as_ref(), out),
                Err(what) => {
                    let failure = move |before| {
                        let what = format!("stdin: row {} (from 0): {what}", before + index as u64);
                        Failure::new(Exit::Input, what).help("give every row a finite origin and a direction")
                    };
                    return Err(Stop::Bad(Box::new(failure)));
                }
            }
        }
        Ok(())
    }
}

/// An answer as a record.
fn write(answer: Option<&Answer>, out: &mut Vec<u8>) {
    let (object, prim) = answer.map_or((-1, -1), |a| (i64::from(a.object), i64::from(a.prim)));
    let [p, n, ng] = answer.map_or([DVec3::NAN; 3], |a| [a.p, a.n, a.ng]);
    let uv = answer.map_or(DVec2::NAN, |a| a.uv);
    out.push(u8::from(answer.is_some()));
    out.extend(answer.map_or(f64::INFINITY, |a| a.t).to_le_bytes());
    for v in [p, n, ng] {
        v.to_array().iter().for_each(|x| out.extend(x.to_le_bytes()));
    }
    uv.to_array().iter().for_each(|x| out.extend(x.to_le_bytes()));
    out.extend(object.to_le_bytes());
    out.extend(prim.to_le_bytes());
    out.push(u8::from(answer.is_some_and(|a| a.entering)));
}
