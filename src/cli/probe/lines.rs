//! One JSON object a line.

use super::json::{At, Fault};
use super::line::{self, Placed};
use super::stream::{Items, MOST, Stop};
use crate::cli::exit::{Exit, Failure, Place};
use memchr::{memchr, memchr_iter, memrchr};
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use tison::backend::{BuildOptions, Error, ExactMaker};
use tison::probe::{Answer, Prober};
use tison::scene::Scene;

/// Answers lines, about a scene or about the shape of each.
pub struct Lines<'a> {
    scene: Option<&'a Prober>,
    maker: &'a ExactMaker,
    cancel: &'a AtomicBool,
}

/// The shape that was asked about last.
type Last = Option<(Placed, Prober)>;

/// What is wrong with a line.
enum Wrong {
    Line(Fault),
    Backend(Error),
}

impl From<Fault> for Wrong {
    fn from(fault: Fault) -> Self {
        Self::Line(fault)
    }
}

impl<'a> Lines<'a> {
    pub fn new(scene: Option<&'a Prober>, maker: &'a ExactMaker, cancel: &'a AtomicBool) -> Self {
        Self { scene, maker, cancel }
    }

    fn line(&self, line: &[u8], last: &mut Last) -> Result<Option<Answer>, Wrong> {
        let Some(prober) = self.scene else { return self.shape(line, last) };
        Ok(prober.probe(&line::ray(line)?))
    }

    fn shape(&self, line: &[u8], last: &mut Last) -> Result<Option<Answer>, Wrong> {
        let (At { at, value: placed }, ray) = line::shape_and_ray(line)?;
        if let Some((of, prober)) = last
            && *of == placed
        {
            return Ok(prober.probe(&ray));
        }
        let (_, prober) = last.insert((placed, self.prober(&placed, at)?));
        Ok(prober.probe(&ray))
    }

    fn prober(&self, placed: &Placed, at: usize) -> Result<Prober, Wrong> {
        let scene = Scene::of_one(placed.shape, &placed.to_world).map_err(|e| Fault::new(at, e.to_string()))?;
        let options = BuildOptions { threads: 1, rays_expected: 1, ..BuildOptions::new(self.cancel) };
        Prober::build(scene, self.maker, &options).map_err(Wrong::Backend)
    }
}

impl Items for Lines<'_> {
    fn whole(&self, pending: &[u8], before: u64, all: bool) -> Result<usize, Failure> {
        match memrchr(b'\n', pending) {
            _ if all => Ok(pending.len()),
            Some(end) => Ok(end + 1),
            None if pending.len() >= MOST => {
                Err(Failure::new(Exit::Input, format!("stdin:{}: this line is longer than {MOST} bytes", before + 1)))
            }
            None => Ok(0),
        }
    }

    fn cut(&self, bytes: &[u8], size: usize) -> usize {
        match bytes.get(size..).and_then(|rest| memchr(b'\n', rest)) {
            Some(end) => size + end + 1,
            None => bytes.len(),
        }
    }

    fn count(&self, bytes: &[u8]) -> u64 {
        memchr_iter(b'\n', bytes).count() as u64
    }

    fn answer(&self, part: &[u8], out: &mut Vec<u8>) -> Result<(), Stop> {
        let mut last = None;
        let (mut rest, mut number) = (part, 0);
        while !rest.is_empty() {
            if self.cancel.load(Relaxed) {
                return Err(Stop::Cancelled);
            }
            let end = memchr(b'\n', rest);
            let line = &rest[..end.unwrap_or(rest.len())];
            rest = end.map_or(&[], |end| &rest[end + 1..]);
            number += 1;
            if line.trim_ascii().is_empty() {
                continue;
            }
            match self.line(line, &mut last) {
                Ok(answer) => write(answer.as_ref(), out),
                Err(Wrong::Line(fault)) => {
                    let text = String::from_utf8_lossy(line).into_owned();
                    let column = 1 + String::from_utf8_lossy(&line[..fault.at.min(line.len())]).chars().count() as u64;
                    return Err(Stop::Bad(Box::new(move |before| {
                        bad_line(before + number, column, text, &fault.what)
                    })));
                }
                Err(Wrong::Backend(Error::Cancelled)) => return Err(Stop::Cancelled),
                Err(Wrong::Backend(error)) => {
                    let failure = move |before| {
                        Failure::new(Exit::Input, format!("stdin:{}: this shape cannot be traced", before + number))
                            .because(error)
                    };
                    return Err(Stop::Bad(Box::new(failure)));
                }
            }
        }
        Ok(())
    }
}

fn bad_line(number: u64, column: u64, text: String, what: &str) -> Failure {
    let failure = Failure::new(Exit::Input, format!("stdin:{number}:{column}: {what}"));
    Failure { place: Place::Line(text, number, column), ..failure }
}

/// An answer as a line.
fn write(answer: Option<&Answer>, out: &mut Vec<u8>) {
    let Some(a) = answer else { return out.extend_from_slice(b"{\"hit\":false}\n") };
    out.extend_from_slice(b"{\"hit\":true,\"t\":");
    number(a.t, out);
    for (key, v) in [(&b",\"p\":"[..], a.p), (b",\"n\":", a.n), (b",\"ng\":", a.ng)] {
        out.extend_from_slice(key);
        list(&v.to_array(), out);
    }
    out.extend_from_slice(b",\"uv\":");
    list(&a.uv.to_array(), out);
    if let Some(texcoord) = a.texcoord {
        out.extend_from_slice(b",\"texcoord\":");
        list(&texcoord.to_array(), out);
    }
    writeln!(out, ",\"object\":{},\"prim\":{},\"entering\":{}}}", a.object, a.prim, a.entering)
        .expect("memory takes everything");
}

fn list(values: &[f64], out: &mut Vec<u8>) {
    let mut before = b'[';
    for &value in values {
        out.push(before);
        number(value, out);
        before = b',';
    }
    out.push(b']');
}

/// The shortest digits that are read back as the same number.
fn number(value: f64, out: &mut Vec<u8>) {
    out.extend_from_slice(zmij::Buffer::new().format_finite(value).as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec2, DVec3};

    #[test]
    fn an_answer_is_json_that_reads_back() {
        let answer = Answer {
            t: 0.1 + 0.2,
            p: DVec3::new(1e300, -0.0, 5e-324),
            n: DVec3::Z,
            ng: -DVec3::Z,
            uv: DVec2::new(0.25, 1.0 / 3.0),
            texcoord: Some(DVec2::new(0.5, 0.125)),
            object: 2,
            prim: 4_294_967_294,
            entering: false,
        };
        let mut out = Vec::new();
        write(Some(&answer), &mut out);
        let value: serde_json::Value = serde_json::from_slice(&out).expect("JSON");
        assert_eq!(value["t"].as_f64(), Some(answer.t));
        assert_eq!(value["prim"].as_u64(), Some(4_294_967_294));
        let text = String::from_utf8(out).expect("ASCII");
        assert!(
            text.starts_with(r#"{"hit":true,"t":0.30000000000000004,"p":[1e+300,-0.0,5e-324],"n":[0.0,0.0,1.0]"#),
            "{text}"
        );
        assert!(
            text.ends_with("\"texcoord\":[0.5,0.125],\"object\":2,\"prim\":4294967294,\"entering\":false}\n"),
            "{text}"
        );
    }
}
