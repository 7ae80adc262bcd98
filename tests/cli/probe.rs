//! `tison probe`: the contract of its lines and arrays, messages, exit codes, streams.

use super::{Bench, text};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Command, Output, Stdio};

const BACKENDS: &[&str] = if cfg!(feature = "embree") { &["embree", "native"] } else { &["native"] };

fn ask(bench: &Bench, words: &str, input: impl Into<Vec<u8>>) -> Output {
    bench.command(&format!("probe {words}")).write_stdin(input).output().unwrap()
}

#[track_caller]
fn answers(output: &Output) -> Vec<Value> {
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    text(&output.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
}

#[test]
fn each_shape_of_its_own() {
    let bench = Bench::new();
    let ray = r#""ray":{"o":[0.25,0.25,5],"d":[0,0,-0.5],"tmin":0,"tmax":null}"#;
    let lines = [
        r#""shape":"sphere","params":{"radius":1,"center":[0.25,0.25,1]}"#,
        r#""shape":"cube","params":{"half":[1,1,2]}"#,
        r#""shape":"cube","params":{"half":[1,1,1],"center":[0,0,1]}"#,
        r#""params":{"radius":1,"height":4,"capped":true},"shape":"cylinder""#,
        r#""shape":"cylinder","params":{"radius":1,"height":4}"#,
        r#""shape":"quad","params":{"half":1},"object_to_world":[[1,0,0,0],[0,1,0,0],[0,0,1,2],[0,0,0,1]]"#,
        r#""shape":"quad","params":{"half":[1,0.2]}"#,
        r#""shape":"triangle","params":{"a":[0,0,2],"b":[1,0,2],"c":[0,1,2]}"#,
    ];
    let input: String = lines.iter().map(|line| format!("{{{line},{ray}}}\n")).collect();
    for backend in BACKENDS {
        let all = answers(&ask(&bench, &format!("--backend {backend} -j 2"), input.clone()));
        assert_eq!(all.len(), lines.len());
        for (line, answer) in lines.iter().zip(&all) {
            let missed = line.contains("height\":4}") || line.contains("0.2]");
            let want =
                if missed { json!({"hit": false}) } else { json!({"hit": true, "t": 6.0, "p": [0.25, 0.25, 2.0]}) };
            for (key, value) in want.as_object().unwrap() {
                assert_eq!(&answer[key], value, "{backend}: {line}: {answer}");
            }
            if !missed {
                assert_eq!((&answer["n"], &answer["ng"]), (&json!([0.0, 0.0, 1.0]), &answer["n"]), "{line}: {answer}");
                assert_eq!(
                    (&answer["object"], &answer["prim"], &answer["entering"]),
                    (&json!(0), &json!(0), &json!(true))
                );
            }
        }
        assert_eq!(all[7]["uv"], json!([0.25, 0.25]));
    }
}

const SCENE: &str = "tison = 1\n[[object]]\nshape = \"sphere\"\nradius = 1.0\n\
                     [[object]]\nshape = \"sphere\"\nradius = 1.0\ntransform = [{ translate = [5, 0, 0] }]\n\
                     [[object]]\nmesh = \"a.obj\"\ntransform = [{ translate = [10, 0, 0] }]\n";

#[test]
fn rays_at_a_scene_and_at_a_mesh() {
    let bench = Bench::new();
    bench.write("s.toml", SCENE);
    for backend in BACKENDS {
        let rays = "{\"o\":[0,0,5],\"d\":[0,0,-1]}\n{\"ray\":{\"o\":[5,0,5],\"d\":[0,0,-2]}}\n\n  \r\n\
                    {\"o\":[10.25,0.25,-5],\"d\":[0,0,1],\"tmax\":4.9}\n{\"o\":[10.25,0.25,-5],\"d\":[0,0,1]}";
        let all = answers(&ask(&bench, &format!("s.toml --backend {backend}"), rays));
        let told = |a: &Value| (a["t"].as_f64(), a["object"].as_u64(), a["prim"].as_u64());
        assert_eq!(told(&all[0]), (Some(4.0), Some(0), Some(0)));
        assert_eq!(told(&all[1]), (Some(2.0), Some(0), Some(1)));
        assert_eq!(all[2], json!({"hit": false}));
        assert_eq!(told(&all[3]), (Some(5.0), Some(1), Some(0)));
        let all = answers(&ask(&bench, &format!("a.obj --backend {backend}"), "{\"o\":[0.25,0.5,-3],\"d\":[0,0,1]}\n"));
        // The first face is wound 1 3 2.
        assert_eq!((&all[0]["uv"], &all[0]["ng"]), (&json!([0.5, 0.25]), &json!([0.0, 0.0, -1.0])));
    }
}

/// A triangle so small beside its neighbour that its corners, rounded to f32, would turn it by a thousandth.
#[test]
fn a_mesh_has_the_corners_of_its_file() {
    let bench = Bench::new();
    let corners = [[0.70001, 0.3, 0.1], [0.70011, 0.30003, 0.10005], [0.70002, 0.30012, 0.10001]];
    let lines = corners.map(|[x, y, z]: [f64; 3]| format!("v {x} {y} {z}\n")).concat();
    bench.write("a.obj", format!("v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\n{lines}f 1 2 3\nf 4 5 6\n"));
    let [a, b, c] = corners.map(glam::DVec3::from);
    let normal = (b - a).cross(c - a).normalize();
    let target = (a + b + c) / 3.0;
    let (o, d) = (target + glam::DVec3::new(0.3, 0.1, 2.0), glam::DVec3::new(-0.3, -0.1, -2.0));
    let ray = json!({"o": o.to_array(), "d": d.to_array()}).to_string();
    for (backend, reader) in BACKENDS.iter().flat_map(|b| [(b, "own"), (b, "tobj")]) {
        let answer = &answers(&ask(&bench, &format!("a.obj --backend {backend} --obj-reader {reader}"), &*ray))[0];
        let vector = |key: &str| glam::DVec3::from_array(std::array::from_fn(|k| answer[key][k].as_f64().unwrap()));
        assert_eq!(answer["prim"], json!(1), "{backend}, {reader}");
        assert!((answer["t"].as_f64().unwrap() - 1.0).abs() < 1e-12, "{backend}, {reader}: {answer}");
        assert!((vector("ng") - normal).length() < 1e-9, "{backend}, {reader}: {answer}");
        assert!((vector("p") - target).length() < 1e-12, "{backend}, {reader}: {answer}");
    }
}

#[test]
fn numbers_keep_every_bit() {
    let bench = Bench::new();
    // What a reader that rounds twice gets wrong by a bit.
    let z = "9007199254740993.0000000000000000000000000000000001e-16";
    let exact: f64 = z.parse().unwrap();
    let input = format!(r#"{{"shape":"quad","params":{{"half":1}},"ray":{{"o":[0,0,{z}],"d":[0,0,-1]}}}}"#);
    for backend in BACKENDS {
        let all = answers(&ask(&bench, &format!("--backend {backend}"), input.clone()));
        assert_eq!(all[0]["t"].as_f64().map(f64::to_bits), Some(exact.to_bits()));
    }
}

struct Bad {
    line: &'static str,
    says: &'static [&'static str],
}

#[test]
fn a_bad_line_says_where_and_what_after_the_answers_before_it() {
    let good = r#"{"shape":"sphere","params":{"radius":1},"ray":{"o":[0,0,5],"d":[0,0,-1]}}"#;
    let cases = [
        Bad { line: "hello", says: &["stdin:3:1: unexpected `hello`", "expected an object", "3 | hello"] },
        Bad { line: "{\"shape\":\"sphere\"", says: &["stdin:3:18: the line ends too early"] },
        Bad { line: r#"{"shape":"sphere","params":{"radius":1}}"#, says: &["stdin:3:1:", "`ray` is missing"] },
        Bad { line: r#"{"shape":"sphere","params":{},"ray":{"o":[0,0,5],"d":[0,0,1]}}"#, says: &["3:28:", "`radius`"] },
        Bad {
            line: r#"{"shape":"sphere","params":{"radius":-1},"ray":{"o":[0,0,5],"d":[0,0,1]}}"#,
            says: &["3:38: radius is -1", "above 0"],
        },
        Bad {
            line: r#"{"shape":"sphere","params":{"raduis":1},"ray":{"o":[0,0,5],"d":[0,0,1]}}"#,
            says: &["3:29: unknown key `raduis`", "did you mean `radius`"],
        },
        Bad {
            line: r#"{"shape":"sphere","params":{"radius":1,"height":1},"ray":{"o":[0,0,5],"d":[0,0,1]}}"#,
            says: &["3:40: a sphere has no `height`"],
        },
        Bad {
            line: r#"{"shape":"cub","params":{"half":[1,1,1]},"ray":{"o":[0,0,5],"d":[0,0,1]}}"#,
            says: &["3:10: no shape is called `cub`", "did you mean `cube`"],
        },
        Bad {
            line: r#"{"shape":"cube","params":{"half":[1,1]},"ray":{"o":[0,0,5],"d":[0,0,1]}}"#,
            says: &["3:34: 2 half sizes; expected three"],
        },
        Bad {
            line: r#"{"shape":"sphere","params":{"radius":1},"ray":{"o":[0,0,NaN],"d":[0,0,1]}}"#,
            says: &["3:57: unexpected `NaN`; expected a number"],
        },
        Bad {
            line: r#"{"shape":"sphere","params":{"radius":1},"ray":{"o":[0,0,1e400],"d":[0,0,1]}}"#,
            says: &["3:57: `1e400`", "1.8e308"],
        },
        Bad {
            line: r#"{"shape":"sphere","params":{"radius":1},"ray":{"o":[0,0,5],"d":[0,-0,0]}}"#,
            says: &["3:64: a direction of length 0"],
        },
        Bad {
            line: r#"{"shape":"sphere","params":{"radius":1},"ray":{"o":[0,0,5],"d":[0,0]}}"#,
            says: &["3:64: 2 values; expected three numbers"],
        },
        Bad {
            line: r#"{"shape":"sphere","params":{"radius":1},"o":[0,0,5],"d":[0,0,1]}"#,
            says: &["3:41: `o` belongs inside of `ray`"],
        },
        Bad {
            line: r#"{"shape":"sphere","params":{"radius":1},"object_to_world":[[1,0,0,0],[0,1,0,0],[1,1,0,0],[0,0,0,1]],"ray":{"o":[0,0,5],"d":[0,0,1]}}"#,
            says: &["stdin:3:59: the transform is singular"],
        },
        Bad {
            line: r#"{"shape":"sphere","params":{"radius":1},"object_to_world":[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]],"ray":{"o":[0,0,5],"d":[0,0,1]}}"#,
            says: &["3:90: the last row"],
        },
        Bad { line: r#"{"shape":"sphere","shape":"sphere"}"#, says: &["3:19: the key `shape` is given twice"] },
        Bad { line: "\u{fffd}{", says: &["stdin:3:1: unexpected"] },
    ];
    let bench = Bench::new();
    for Bad { line, says } in cases {
        let output = ask(&bench, "", format!("{good}\n{good}\n{line}\n{good}\n"));
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{line}: {message}");
        assert_eq!(text(&output.stdout).lines().count(), 2, "{line}");
        for word in says {
            assert!(message.contains(word), "{line}: {word} is not in\n{message}");
        }
    }
}

#[test]
fn what_belongs_to_the_other_form_is_told_apart() {
    let bench = Bench::new();
    for (line, says) in [
        (
            r#"{"shape":"sphere","ray":{"o":[0,0,5],"d":[0,0,1]}}"#,
            "1:2: a line brings its own `shape` only where no SCENE",
        ),
        (
            r#"{"o":[0,0,5],"dir":[0,0,1]}"#,
            "1:14: unknown key `dir`; expected one of o, d, tmin, tmax; did you mean `d`?",
        ),
        (r#"{"o":[0,0,5]}"#, "1:1: the key `d` is missing"),
        (r#"{"ray":{"o":[0,0,5],"d":[0,0,1]},"tmin":1}"#, "both inside of `ray` and beside it"),
    ] {
        let output = ask(&bench, "a.obj", line);
        assert_eq!(output.status.code(), Some(3), "{line}");
        assert!(text(&output.stderr).contains(says), "{line}: {}", text(&output.stderr));
    }
}

#[test]
fn the_line_number_is_right_after_many_lines() {
    let bench = Bench::new();
    let line = "{\"o\":[0.25,0.25,5],\"d\":[0,0,-1]}\n";
    let input = line.repeat(20_000) + "\n\n{\"o\":1}\n" + &line.repeat(1000);
    let output = ask(&bench, "a.obj", input);
    assert_eq!(output.status.code(), Some(3));
    assert!(text(&output.stderr).contains("stdin:20003:6:"), "{}", text(&output.stderr));
    assert_eq!(text(&output.stdout).lines().count(), 20_000);
}

#[test]
fn flags_and_scenes_that_are_wrong() {
    let bench = Bench::new();
    for (words, code, says) in [
        ("--format npy", 2, "name a scene"),
        ("--format xml", 2, "jsonl"),
        ("--backend cuda", 2, "native"),
        ("-j 0", 2, "--threads"),
        ("-D a=1", 2, "scene file"),
        ("a.obj -D a=1", 2, "scene file"),
        ("nowhere.obj", 3, "cannot read nowhere.obj"),
    ] {
        let output = ask(&bench, words, "");
        assert_eq!(output.status.code(), Some(code), "{words}: {}", text(&output.stderr));
        assert!(text(&output.stderr).contains(says), "{words}: {}", text(&output.stderr));
        assert!(output.stdout.is_empty(), "{words}");
    }
    for words in ["", "a.obj", "a.obj --format npy"] {
        let output = ask(&bench, words, "");
        assert_eq!(
            (output.status.code(), output.stdout.len(), output.stderr.len()),
            (Some(0), 0, 0),
            "{words}: empty input"
        );
    }
}

/// A process that does not outlive its test.
struct Process(Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

fn start(bench: &Bench, words: &[&str]) -> Process {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tison"));
    command.current_dir(bench.dir.path()).arg("probe").args(words);
    Process(command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap())
}

#[test]
fn another_program_can_ask_and_wait_and_ctrl_c_leaves() {
    let bench = Bench::new();
    let mut process = start(&bench, &["a.obj"]);
    let mut to = process.0.stdin.take().unwrap();
    let mut from = BufReader::new(process.0.stdout.take().unwrap());
    for i in 0..20 {
        writeln!(to, "{{\"o\":[0.25,0.25,{}],\"d\":[0,0,1]}}", -1 - i).unwrap();
        let mut line = String::new();
        from.read_line(&mut line).unwrap();
        let answer: Value = serde_json::from_str(&line).unwrap();
        assert_eq!(answer["t"].as_f64(), Some(f64::from(1 + i)));
    }
    let sent = Command::new("sh").args(["-c", &format!("kill -INT {}", process.0.id())]).status().unwrap();
    assert!(sent.success());
    assert_eq!(process.0.wait().unwrap().code(), Some(130), "with stdin still open");
}

#[test]
fn a_reader_that_has_had_enough_is_no_error() {
    let bench = Bench::new();
    let mut process = start(&bench, &["a.obj"]);
    drop(process.0.stdout.take());
    let mut to = process.0.stdin.take().unwrap();
    let line = "{\"o\":[0.25,0.25,5],\"d\":[0,0,-1]}\n".repeat(1000);
    // It may leave before all is sent.
    for _ in 0..50 {
        if to.write_all(line.as_bytes()).is_err() {
            break;
        }
    }
    drop(to);
    let mut message = String::new();
    std::io::Read::read_to_string(&mut process.0.stderr.take().unwrap(), &mut message).unwrap();
    assert_eq!((process.0.wait().unwrap().code(), &*message), (Some(0), ""));
}

fn npy(descr: &str, rows: usize, columns: usize, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({rows}, {columns}), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    bytes.extend(data);
    bytes
}

/// The header and the records of an answer.
fn records(output: &[u8]) -> (&str, Vec<&[u8]>) {
    const RECORD: usize = 1 + 12 * 8 + 2 * 8 + 1;
    let length = usize::from(u16::from_le_bytes([output[8], output[9]]));
    let (header, data) = output[10..].split_at(length);
    assert_eq!((10 + length) % 64, 0);
    assert_eq!(data.len() % RECORD, 0);
    (text(header), data.chunks_exact(RECORD).collect())
}

fn float(record: &[u8], index: usize) -> f64 {
    f64::from_le_bytes(record[1 + 8 * index..][..8].try_into().unwrap())
}

#[test]
fn arrays_say_what_lines_say() {
    let bench = Bench::new();
    bench.write("s.toml", SCENE);
    let mut rays = Vec::new();
    for i in 0..3000 {
        let x = f64::from(i % 100) * 0.12 - 0.5;
        let y = f64::from(i / 100) * 0.05 - 0.7;
        rays.push([x, y, 7.5, 0.125, 0.0, -1.0, 0.25, if i % 7 == 0 { 7.0 } else { f64::INFINITY }]);
    }
    let lines: String = rays
        .iter()
        .map(|[a, b, c, d, e, f, g, h]| {
            let end = if h.is_finite() { format!(",\"tmax\":{h}") } else { String::new() };
            format!("{{\"o\":[{a},{b},{c}],\"d\":[{d},{e},{f}],\"tmin\":{g}{end}}}\n")
        })
        .collect();
    for backend in BACKENDS {
        let flags = format!("s.toml --backend {backend}");
        let lines = answers(&ask(&bench, &flags, lines.clone()));
        let data: Vec<u8> = rays.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        let output = ask(&bench, &format!("{flags} --format npy"), npy("<f8", rays.len(), 8, &data));
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        let (header, records) = records(&output.stdout);
        assert!(header.contains("'shape': (3000,)") && header.contains("('p', '<f8', (3,))"), "{header}");
        assert_eq!((records.len(), lines.len()), (rays.len(), rays.len()));
        let hits = lines.iter().filter(|line| line["hit"] == true).count();
        assert!(hits > 300 && hits < 2700, "{hits}");
        for (record, line) in records.iter().zip(&lines) {
            assert_eq!(record[0] == 1, line["hit"] == true);
            let ids = [97, 105].map(|at| i64::from_le_bytes(record[at..at + 8].try_into().unwrap()));
            if record[0] == 0 {
                assert_eq!((float(record, 0), ids), (f64::INFINITY, [-1, -1]));
                assert!((1..12).all(|i| float(record, i).is_nan()));
                continue;
            }
            let mut want = vec![&line["t"]];
            for key in ["p", "n", "ng", "uv"] {
                want.extend(line[key].as_array().unwrap());
            }
            for (i, value) in want.iter().enumerate() {
                assert_eq!(value.as_f64().map(f64::to_bits), Some(float(record, i).to_bits()), "{line}");
            }
            assert_eq!(ids.map(|id| id as u64), [&line["object"], &line["prim"]].map(|v| v.as_u64().unwrap()));
            assert_eq!(record[113] == 1, line["entering"] == true);
        }
    }
}

#[test]
fn arrays_of_other_widths_and_bad_ones() {
    let bench = Bench::new();
    let bytes = |values: &[f32]| values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<_>>();
    let row = [0.25, 0.25, -5.0, 0.0, 0.0, 1.0, 5.5];
    let output = ask(&bench, "a.obj --format npy", npy("<f4", 1, 6, &bytes(&row[..6])));
    assert_eq!(float(records(&output.stdout).1[0], 0), 5.0);
    let output = ask(&bench, "a.obj --format npy", npy("<f4", 1, 7, &bytes(&row)));
    let t = float(records(&output.stdout).1[0], 0);
    assert!((t - 5.5).abs() < 1e-6 && t > 5.5 - 1e-15 || t == f64::INFINITY, "{t}");
    let output = ask(&bench, "a.obj --format npy", npy("<f8", 0, 6, &[]));
    assert_eq!((output.status.code(), records(&output.stdout).1.len()), (Some(0), 0));

    let nan = [[0.25, 0.25, -5.0, 0.0, 0.0, 1.0], [0.25, f32::NAN, -5.0, 0.0, 0.0, 1.0]].concat();
    let still = [[0.25, 0.25, -5.0, 0.0, 0.0, 1.0], [0.25, 0.25, -5.0, 0.0, 0.0, 0.0]].concat();
    let short = npy("<f4", 3, 6, &bytes(&nan[..8]));
    let header = npy("<f4", 3, 6, &[])[..20].to_vec();
    for (input, answered, says) in [
        (npy("<f4", 2, 6, &bytes(&nan)), Some(1), "row 1 (from 0): a number that is not finite"),
        (npy("<f4", 2, 6, &bytes(&still)), Some(1), "row 1 (from 0): a direction of length 0"),
        (short, Some(1), "ends after 1 whole rows of 3"),
        (header, None, "ends within the header"),
        (npy("<f4", 1, 5, &[0; 20]), None, "rows of 6, 7 or 8"),
        (npy(">f4", 1, 6, &[0; 24]), None, "little-endian"),
        (b"{\"o\":[0,0,5],\"d\":[0,0,1]}".to_vec(), None, "numpy.save"),
    ] {
        let output = ask(&bench, "a.obj --format npy", input);
        assert_eq!(output.status.code(), Some(3), "{says}");
        assert!(text(&output.stderr).contains(says), "{says}: {}", text(&output.stderr));
        match answered {
            Some(count) => assert_eq!(records(&output.stdout).1.len(), count, "{says}"),
            None => assert!(output.stdout.is_empty(), "{says}"),
        }
    }
}
