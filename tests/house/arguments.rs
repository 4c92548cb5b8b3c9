//! Functions of core take few arguments, and no tuple stands for a struct without a name.
//!
//! A parameter that is a tuple, in its pattern or in its type, counts as its elements; `self` does not count. Closures
//! and code that only tests compile are left out.

use std::fs;
use std::path::{Path, PathBuf};

use syn::visit::{self, Visit};
use syn::{Attribute, FnArg, ImplItemFn, ItemFn, ItemMod, Pat, Signature, TraitItemFn, Type};

/// Arguments that a function may have.
const MOST: usize = 4;

fn core() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/core/src")
}

fn rust_files(path: &Path) -> Vec<PathBuf> {
    if path.is_file() {
        return vec![path.to_path_buf()];
    }
    let mut entries: Vec<PathBuf> = fs::read_dir(path).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    entries.iter().flat_map(|e| rust_files(e)).filter(|p| p.extension().is_some_and(|e| e == "rs")).collect()
}

/// A function and its parameters.
#[derive(Debug, Clone, PartialEq)]
struct Function {
    name: String,
    /// Arguments with tuples unpacked.
    arguments: usize,
    /// Whether a parameter is a tuple.
    tuple: bool,
}

/// Arguments that a pattern takes apart; 0 if it is not a tuple.
fn in_pattern(pattern: &Pat) -> usize {
    match pattern {
        Pat::Tuple(tuple) => tuple.elems.iter().map(|e| in_pattern(e).max(1)).sum(),
        Pat::Reference(reference) => in_pattern(&reference.pat),
        Pat::Paren(paren) => in_pattern(&paren.pat),
        _ => 0,
    }
}

/// Elements of a tuple type, those of tuples within it too; 0 if it is not a tuple.
fn in_type(of: &Type) -> usize {
    match of {
        Type::Tuple(tuple) => tuple.elems.iter().map(|e| in_type(e).max(1)).sum(),
        Type::Reference(reference) => in_type(&reference.elem),
        Type::Paren(paren) => in_type(&paren.elem),
        _ => 0,
    }
}

#[derive(Default)]
struct Functions {
    of: Option<String>,
    found: Vec<Function>,
}

impl Functions {
    fn count(&mut self, signature: &Signature) {
        let unpacked = signature.inputs.iter().filter_map(|input| match input {
            FnArg::Receiver(_) => None,
            FnArg::Typed(typed) => Some(in_pattern(&typed.pat).max(in_type(&typed.ty))),
        });
        let unpacked: Vec<usize> = unpacked.collect();
        let of = self.of.as_ref().map_or(String::new(), |of| format!("{of}::"));
        self.found.push(Function {
            name: format!("{of}{}", signature.ident),
            arguments: unpacked.iter().map(|&n| n.max(1)).sum(),
            tuple: unpacked.iter().any(|&n| n > 0),
        });
    }
}

/// Whether the attributes say that only tests compile an item.
fn only_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|a| {
        a.path().is_ident("test")
            || a.path().is_ident("cfg") && a.parse_args::<syn::Ident>().is_ok_and(|word| word == "test")
    })
}

impl<'a> Visit<'a> for Functions {
    fn visit_item_mod(&mut self, item: &'a ItemMod) {
        if !only_for_tests(&item.attrs) {
            visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_impl(&mut self, item: &'a syn::ItemImpl) {
        if only_for_tests(&item.attrs) {
            return;
        }
        let Type::Path(path) = &*item.self_ty else { return visit::visit_item_impl(self, item) };
        let outer = self.of.replace(path.path.segments.last().map_or(String::new(), |s| s.ident.to_string()));
        visit::visit_item_impl(self, item);
        self.of = outer;
    }

    fn visit_item_fn(&mut self, item: &'a ItemFn) {
        if !only_for_tests(&item.attrs) {
            self.count(&item.sig);
            visit::visit_item_fn(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'a ImplItemFn) {
        if !only_for_tests(&item.attrs) {
            self.count(&item.sig);
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_trait_item_fn(&mut self, item: &'a TraitItemFn) {
        self.count(&item.sig);
        visit::visit_trait_item_fn(self, item);
    }
}

fn functions(text: &str) -> Vec<Function> {
    let mut functions = Functions::default();
    functions.visit_file(&syn::parse_file(text).unwrap());
    functions.found
}

#[test]
fn functions_of_core_have_at_most_four_arguments_and_no_tuples() {
    let mut wrong = Vec::new();
    for path in rust_files(&core()) {
        let name = path.file_stem().unwrap().to_str().unwrap();
        if ["tests", "testing"].contains(&name) {
            continue;
        }
        let found = functions(&fs::read_to_string(&path).unwrap());
        let found = found.into_iter().filter(|f| f.tuple || f.arguments > MOST);
        wrong.extend(found.map(|f| format!("{}: {} has {} arguments", path.display(), f.name, f.arguments)));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_count_unpacks_tuples_and_leaves_out_self_closures_and_tests() {
    let text = "
        fn pair((low, high): (f32, f32), n: usize) {}
        fn nested(&(a, (b, c)): &(u8, (u8, u8))) { let f = |(x, y): (u8, u8)| x + y; }
        fn named(range: &(f32, f32), rows: &[(u8, u8)]) {}
        impl Tree { fn method(&self, a: u8, b: u8) -> (u8, u8) { (a, b) } }
        trait Shape { fn area(&self, (x, y): (f32, f32)); }
        #[cfg(test)] mod tests { fn helper(_: (u8, u8)) {} }
        #[cfg(test)] impl Tree { fn helper(_: u8) {} }
        #[test] fn test() {}";
    let found: Vec<(String, usize, bool)> =
        functions(text).into_iter().map(|f| (f.name, f.arguments, f.tuple)).collect();
    let expected =
        [("pair", 3, true), ("nested", 3, true), ("named", 3, true), ("Tree::method", 2, false), ("area", 2, true)];
    assert_eq!(found, expected.map(|(name, n, tuple)| (name.to_string(), n, tuple)));
}
