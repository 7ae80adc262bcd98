//! The scene language of the course (`.ray`): statements, a stack of matrices, materials by name.
//!
//! What the language leaves open: a statement or key given twice counts as given last, with a
//! warning; names of materials may be used before they are defined; lights are not moved by the
//! current transform; a camera needs both `Perspective` and `LookAt`.

mod build;
mod token;

use super::diagnostic::{Diagnostic, Source};
use super::tree::{Context, Span};
use crate::scene::desc::SceneDesc;
use build::Builder;
use token::{Lexer, Token, Word};

const STATEMENTS: [&str; 20] = [
    "dimension",
    "container",
    "samples_per_pixel",
    "jitter_radius",
    "ambient_light",
    "max_ray_depth",
    "Perspective",
    "LookAt",
    "DOF",
    "Material",
    "PushMatrix",
    "PopMatrix",
    "Translate",
    "Scale",
    "Rotate",
    "Sphere",
    "Quad",
    "Cylinder",
    "Mesh",
    "SphericalLight",
];

/// The scene that `source` describes. Mistakes and warnings go to `ctx`.
pub(super) fn parse(ctx: &Context, source: &Source) -> SceneDesc {
    let mut lexer = Lexer::new(&source.text);
    let word = lexer.next();
    let mut reader = Reader { ctx, file: source.index, lexer, word };
    let mut builder = Builder::new(ctx);
    while reader.word.token != Token::End {
        if reader.statement(&mut builder).is_none() {
            reader.recover();
        }
    }
    let end = reader.span(reader.word);
    builder.finish(end, ctx.paths())
}

/// A value of a parameter list.
#[derive(Clone, Copy, Debug)]
enum Value<'a> {
    Number(f64),
    Vector([f64; 3]),
    String(&'a str),
}

/// A `"key" value` pair and where the two stand.
#[derive(Clone, Copy, Debug)]
struct Parameter<'a> {
    key: &'a str,
    key_at: Span,
    value: Value<'a>,
    at: Span,
}

struct Reader<'a> {
    ctx: &'a Context,
    file: u32,
    lexer: Lexer<'a>,
    /// The next word.
    word: Word<'a>,
}

/// A number or string argument and where it stands.
#[derive(Clone, Copy)]
struct Argument<T> {
    value: T,
    at: Span,
}

impl<'a> Reader<'a> {
    fn span(&self, w: Word<'_>) -> Span {
        Span { file: self.file, start: w.start, end: w.end }
    }

    fn advance(&mut self) -> Word<'a> {
        std::mem::replace(&mut self.word, self.lexer.next())
    }

    /// Steps over the next word and says where it stood.
    fn take(&mut self) -> Span {
        let at = self.span(self.word);
        self.advance();
        at
    }

    fn error<T>(&self, at: Span, what: String, expected: &str) -> Option<T> {
        self.ctx.error(at, |s| Diagnostic::error(s, what).expected(format!("expected {expected}")));
        None
    }

    /// Goes on at the next statement after a mistake: a word that is one, or a name that starts
    /// its line.
    fn recover(&mut self) {
        loop {
            match self.word.token {
                Token::End => return,
                Token::Name(name) if self.word.leads || STATEMENTS.contains(&name) => return,
                _ => self.advance(),
            };
        }
    }

    /// One statement; `None` after a mistake that leaves the rest of it unread.
    fn statement(&mut self, b: &mut Builder<'_>) -> Option<()> {
        let w = self.word;
        let at = self.span(w);
        let Token::Name(name) = w.token else {
            let what = format!("unexpected {}", w.token.describe());
            return self.bad_word().or_else(|| self.error(at, what, "the name of a statement, like Sphere"));
        };
        self.advance();
        match name {
            "dimension" => b.dimension(at, self.numbers(name, ["a width in pixels", "a height in pixels"])?),
            "container" => b.container(at, self.string(name, "\"Naive\" or \"BVH\"")?),
            "samples_per_pixel" => b.samples(at, self.numbers(name, ["a number of camera rays"])?),
            "jitter_radius" => b.jitter(at, self.numbers(name, ["a radius in pixels"])?),
            "ambient_light" => b.ambient(at, self.vector(name)?),
            "max_ray_depth" => b.depth(at, self.numbers(name, ["a number of bounces"])?),
            "Perspective" => {
                let what = ["a field of view in degrees", "an aspect ratio", "a near distance", "a far distance"];
                b.perspective(at, self.numbers(name, what)?);
            }
            "LookAt" => {
                const WHAT: [&str; 9] = [
                    "the eye's x",
                    "the eye's y",
                    "the eye's z",
                    "the target's x",
                    "the target's y",
                    "the target's z",
                    "the up direction's x",
                    "the up direction's y",
                    "the up direction's z",
                ];
                b.look_at(at, self.numbers(name, WHAT)?);
            }
            "DOF" => b.dof(at, self.numbers(name, ["an angle in degrees", "a distance"])?),
            "Material" => {
                let material = self.string(name, "the material's name in quotes")?;
                let (list, complete) = self.parameters(name);
                b.material(at, material, &list);
                complete?;
            }
            "PushMatrix" => b.push(at),
            "PopMatrix" => b.pop(at),
            "Translate" => b.translate(self.numbers(name, ["x", "y", "z"])?),
            "Scale" => b.scale(self.numbers(name, ["x", "y", "z"])?),
            "Rotate" => b.rotate(self.numbers(name, ["an angle in degrees", "the axis's x", "y", "z"])?),
            "Sphere" => {
                let size = self.numbers(name, ["a radius"])?;
                b.sphere(at, size, self.material(name)?);
            }
            "Quad" => {
                let size = self.numbers(name, ["half the side"])?;
                b.quad(at, size, self.material(name)?);
            }
            "Cylinder" => {
                let size = self.numbers(name, ["a radius", "half the height"])?;
                b.cylinder(at, size, self.material(name)?);
            }
            "Mesh" => {
                let file = self.string(name, "the name of an .obj file in quotes")?;
                b.mesh(at, file, self.material(name)?);
            }
            "SphericalLight" => {
                let position = self.numbers(name, ["x", "y", "z"])?;
                let (list, complete) = self.parameters(name);
                b.light(at, position, &list);
                complete?;
            }
            _ => {
                self.ctx.error(at, |s| {
                    Diagnostic::error(s, format!("unknown statement `{name}`"))
                        .expected("expected a statement, like Sphere or Material")
                        .suggest(name, STATEMENTS)
                });
                return None;
            }
        }
        self.end_of(name)
    }

    /// After its last argument a statement is followed by another.
    fn end_of(&mut self, statement: &str) -> Option<()> {
        match self.word.token {
            Token::Name(_) | Token::End => Some(()),
            // Reported by itself, and better.
            Token::Bad(_) => self.bad_word(),
            _ => {
                let what = format!("unexpected {} after `{statement}`", self.word.token.describe());
                self.error(self.span(self.word), what, "the next statement")
            }
        }
    }

    fn bad_word<T>(&self) -> Option<T> {
        let Token::Bad(why) = self.word.token else { return None };
        let expected = match why {
            "a string that does not end" => "a closing `\"` on the same line",
            "no word of a scene" => "a name, a number, a \"string\", [ or ]",
            _ => "a number like 0.5, -3 or 1e-3",
        };
        self.error(self.span(self.word), why.into(), expected)
    }

    fn missing<T>(&self, statement: &str, expected: &str) -> Option<T> {
        if let Token::Bad(_) = self.word.token {
            return self.bad_word();
        }
        let what = format!("unexpected {} in `{statement}`", self.word.token.describe());
        // At the end of the file, where its last word ends: an empty line shows nothing.
        let at = self.span(self.word);
        let end = self.ctx.source(self.file).text.trim_end().len();
        self.error(Span { start: at.start.min(end), end: at.end.min(end).max(at.start.min(end)), ..at }, what, expected)
    }

    fn number(&mut self, statement: &str, expected: &str) -> Option<Argument<f64>> {
        let Token::Number(value) = self.word.token else {
            return self.missing(statement, &format!("a number: {expected}"));
        };
        let at = self.take();
        Some(Argument { value, at })
    }

    fn numbers<const N: usize>(&mut self, statement: &str, expected: [&str; N]) -> Option<[Argument<f64>; N]> {
        let start = Span { file: self.file, start: 0, end: 0 };
        let mut out = [Argument { value: 0.0, at: start }; N];
        for (slot, what) in out.iter_mut().zip(expected) {
            *slot = self.number(statement, what)?;
        }
        Some(out)
    }

    fn string(&mut self, statement: &str, expected: &str) -> Option<Argument<&'a str>> {
        let Token::String(value) = self.word.token else { return self.missing(statement, expected) };
        let at = self.take();
        Some(Argument { value, at })
    }

    fn material(&mut self, statement: &str) -> Option<Argument<&'a str>> {
        self.string(statement, "the name of a material in quotes")
    }

    /// `[a b c]`.
    fn vector(&mut self, statement: &str) -> Option<Argument<[f64; 3]>> {
        if self.word.token != Token::Open {
            return self.missing(statement, "3 numbers in brackets: [r g b]");
        }
        let open = self.advance();
        let [x, y, z] = self.numbers(statement, ["[r g b]"; 3])?;
        if self.word.token != Token::Close {
            return self.missing(statement, "`]` after 3 numbers");
        }
        let close = self.advance();
        let at = Span { file: self.file, start: open.start, end: close.end };
        Some(Argument { value: [x.value, y.value, z.value], at })
    }

    /// Any run of `"key" value` pairs, those before a mistake as well; and whether there was none.
    fn parameters(&mut self, statement: &str) -> (Vec<Parameter<'a>>, Option<()>) {
        let mut list: Vec<Parameter<'a>> = Vec::new();
        while let Token::String(key) = self.word.token {
            let key_at = self.take();
            let Some((value, at)) = self.value(statement, key) else { return (list, None) };
            if let Some(first) = list.iter().find(|p| p.key == key) {
                self.ctx.warn(key_at, |s| {
                    Diagnostic::warning(s, format!("\"{key}\" is given twice; the last one counts"))
                        .related(self.ctx.spot(first.key_at), "first given here")
                });
            }
            list.push(Parameter { key, key_at, value, at });
        }
        (list, Some(()))
    }

    fn value(&mut self, statement: &str, key: &str) -> Option<(Value<'a>, Span)> {
        match self.word.token {
            Token::Number(x) => Some((Value::Number(x), self.take())),
            Token::String(s) => Some((Value::String(s), self.take())),
            Token::Open => self.vector(statement).map(|v| (Value::Vector(v.value), v.at)),
            _ => self.missing(statement, &format!("a value for \"{key}\": a number, [r g b] or a \"string\"")),
        }
    }
}
