//! The shape of core: a module uses only modules above it in the list of `crates/core/src/lib.rs`, a folder holds at most
//! [`MOST_FILES`] files, and the submodules of a folder do not use each other in a circle.
//!
//! Code that only tests compile does not count.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use syn::visit::{self, Visit};
use syn::{Attribute, Item, ItemFn, ItemMod, ItemUse, Macro, UseTree, VisRestricted};

/// Files that a folder may hold, `mod.rs` among them.
const MOST_FILES: usize = 12;

fn core() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/core/src")
}

/// The modules in the order of `lib.rs`.
fn rooms() -> Vec<String> {
    let lib = fs::read_to_string(core().join("lib.rs")).unwrap();
    lib.lines().filter_map(|l| Some(l.trim().strip_prefix("pub mod ")?.strip_suffix(';')?.to_string())).collect()
}

fn rust_files(path: &Path) -> Vec<PathBuf> {
    if path.is_file() {
        return vec![path.to_path_buf()];
    }
    fs::read_dir(path)
        .unwrap()
        .flat_map(|e| rust_files(&e.unwrap().path()))
        .filter(|p| p.extension().is_some_and(|e| e == "rs"))
        .collect()
}

/// Names that follow `crate::` in a source text, those in braces too.
fn used(text: &str) -> BTreeSet<String> {
    let mut used = BTreeSet::new();
    for (at, _) in text.match_indices("crate::") {
        let line = text[..at].rfind('\n').map_or(0, |n| n + 1);
        if text[line..at].trim_start().starts_with("//") {
            continue;
        }
        let rest = &text[at + 7..];
        let list = rest.strip_prefix('{').and_then(|r| r.split_once('}')).map_or(rest, |(inside, _)| inside);
        let parts: Vec<&str> = if rest.starts_with('{') { list.split(',').collect() } else { vec![rest] };
        used.extend(
            parts.iter().map(|p| p.trim().chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>()),
        );
    }
    used
}

#[test]
fn the_list_of_rooms_is_the_order_of_the_data() {
    let rooms = rooms();
    for pair in [
        ["cloud", "voxels"],
        ["voxels", "neighbours"],
        ["cloud", "io"],
        ["io", "features"],
        ["features", "classification"],
        ["classification", "recipes"],
    ] {
        let place = |name| rooms.iter().position(|r| r == name).unwrap();
        assert!(place(pair[0]) < place(pair[1]), "{pair:?}");
    }
}

#[test]
fn rooms_use_only_rooms_above_them() {
    let rooms = rooms();
    let mut broken = Vec::new();
    for (place, room) in rooms.iter().enumerate() {
        let folder = core().join(room);
        let start = if folder.is_dir() { folder } else { core().join(format!("{room}.rs")) };
        for file in rust_files(&start) {
            let text = fs::read_to_string(&file).unwrap();
            let below = used(&text).into_iter().filter(|u| rooms[place + 1..].contains(u));
            broken.extend(below.map(|b| format!("{} uses {b}, a room below {room}", file.display())));
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn the_check_sees_uses_in_every_form() {
    let text = "use crate::io::read;\nuse crate::{features::X, error};\n// crate::recipes\nlet a = crate::images::b();";
    let expected = ["error", "features", "images", "io"].map(String::from);
    assert_eq!(used(text).into_iter().collect::<Vec<_>>(), expected);
}

/// A path from the root of core, e.g. `io`, `las`, `read`.
type ModulePath = Vec<String>;

/// The module of a file.
fn module_of(file: &Path) -> ModulePath {
    let place = file.strip_prefix(core()).unwrap().with_extension("");
    let mut module: ModulePath = place.iter().map(|part| part.to_str().unwrap().to_string()).collect();
    module.pop_if(|last| last == "mod");
    module
}

/// Whether the attributes say that only tests compile an item.
fn only_for_tests(attributes: &[Attribute]) -> bool {
    attributes.iter().any(|a| {
        a.path().is_ident("test")
            || a.path().is_ident("cfg") && a.parse_args::<syn::Ident>().is_ok_and(|word| word == "test")
    })
}

/// The paths from the root that a source text uses; text in macros is searched for `crate::` and `super::`.
struct Uses {
    /// The module in which the visitor stands.
    module: ModulePath,
    found: BTreeSet<ModulePath>,
}

impl Uses {
    fn of(text: &str, module: ModulePath) -> BTreeSet<ModulePath> {
        let mut uses = Self { module, found: BTreeSet::new() };
        uses.visit_file(&syn::parse_file(text).unwrap());
        uses.found
    }

    fn add(&mut self, path: &[String]) {
        let mut base = self.module.clone();
        let rest = match path.first().map(String::as_str) {
            Some("crate") => {
                base.clear();
                &path[1..]
            }
            Some("self") => &path[1..],
            Some("super") => path,
            _ => return,
        };
        let up = rest.iter().take_while(|part| *part == "super").count();
        base.truncate(base.len().saturating_sub(up));
        base.extend_from_slice(&rest[up..]);
        self.found.insert(base);
    }

    fn add_tree(&mut self, before: &[String], tree: &UseTree) {
        let with = |name: String| [before, &[name]].concat();
        match tree {
            UseTree::Path(path) => self.add_tree(&with(path.ident.to_string()), &path.tree),
            UseTree::Name(name) if name.ident == "self" => self.add(before),
            UseTree::Name(name) => self.add(&with(name.ident.to_string())),
            UseTree::Rename(rename) => self.add(&with(rename.ident.to_string())),
            UseTree::Glob(_) => self.add(before),
            UseTree::Group(group) => group.items.iter().for_each(|tree| self.add_tree(before, tree)),
        }
    }
}

impl<'a> Visit<'a> for Uses {
    fn visit_item(&mut self, item: &'a Item) {
        let attributes = match item {
            Item::Impl(item) => &item.attrs,
            Item::Use(item) => &item.attrs,
            Item::Struct(item) => &item.attrs,
            Item::Const(item) => &item.attrs,
            _ => &Vec::new(),
        };
        if !only_for_tests(attributes) {
            visit::visit_item(self, item);
        }
    }

    fn visit_item_mod(&mut self, item: &'a ItemMod) {
        if !only_for_tests(&item.attrs) {
            self.module.push(item.ident.to_string());
            visit::visit_item_mod(self, item);
            self.module.pop();
        }
    }

    fn visit_item_fn(&mut self, item: &'a ItemFn) {
        if !only_for_tests(&item.attrs) {
            visit::visit_item_fn(self, item);
        }
    }

    fn visit_impl_item_fn(&mut self, item: &'a syn::ImplItemFn) {
        if !only_for_tests(&item.attrs) {
            visit::visit_impl_item_fn(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'a ItemUse) {
        self.add_tree(&[], &item.tree);
    }

    fn visit_path(&mut self, path: &'a syn::Path) {
        self.add(&path.segments.iter().map(|s| s.ident.to_string()).collect::<Vec<_>>());
        visit::visit_path(self, path);
    }

    fn visit_macro(&mut self, item: &'a Macro) {
        let text: String = item.tokens.to_string().replace(" :: ", "::");
        for word in text.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')) {
            self.add(&word.split("::").map(String::from).collect::<Vec<_>>());
        }
    }

    /// Who may see an item is no use.
    fn visit_vis_restricted(&mut self, _: &'a VisRestricted) {}

    fn visit_attribute(&mut self, _: &'a Attribute) {}
}

/// Submodules that `mod.rs` declares for tests only.
fn tests_of(folder: &Path) -> BTreeSet<String> {
    let items = fs::read_to_string(folder.join("mod.rs")).map(|text| syn::parse_file(&text).unwrap().items);
    let declared = items.unwrap_or_default().into_iter().filter_map(|item| match item {
        Item::Mod(item) if only_for_tests(&item.attrs) => Some(item.ident.to_string()),
        _ => None,
    });
    declared.chain(["tests", "testing"].map(String::from)).collect()
}

/// All folders of core, the rooms and those in them.
fn folders(from: &Path) -> Vec<PathBuf> {
    let inside = fs::read_dir(from).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_dir());
    let mut found: Vec<PathBuf> = inside.flat_map(|p| [vec![p.clone()], folders(&p)].concat()).collect();
    found.sort();
    found
}

fn name_in_core(folder: &Path) -> String {
    folder.strip_prefix(core()).unwrap().to_str().unwrap().to_string()
}

/// Submodules of a folder, each with those that it uses. What `mod.rs` re-exports counts as what it comes from.
fn submodules(folder: &Path) -> BTreeMap<String, BTreeSet<String>> {
    let here = module_of(&folder.join("mod.rs"));
    let tests = tests_of(folder);
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    let children: BTreeMap<String, PathBuf> = entries
        .map(|path| (path.file_stem().unwrap().to_str().unwrap().to_string(), path))
        .filter(|(name, path)| {
            name != "mod" && !tests.contains(name) && (path.is_dir() || path.extension().is_some_and(|e| e == "rs"))
        })
        .collect();
    let exported = exports(&fs::read_to_string(folder.join("mod.rs")).unwrap_or_default());
    let child = |name: &String| match children.contains_key(name) {
        true => Some(name.clone()),
        false => exported.get(name).filter(|from| children.contains_key(*from)).cloned(),
    };
    let used = |(name, path): (&String, &PathBuf)| {
        let files = rust_files(path).into_iter().filter(|file| !for_tests(file, path));
        let paths = files.flat_map(|file| Uses::of(&fs::read_to_string(&file).unwrap(), module_of(&file)));
        let inside = paths.filter_map(|used| child(used.strip_prefix(&here[..])?.first()?));
        (name.clone(), inside.filter(|used| used != name).collect())
    };
    children.iter().map(used).collect()
}

/// Whether a file below a submodule is compiled for tests only.
fn for_tests(file: &Path, submodule: &Path) -> bool {
    let above = file.ancestors().take_while(|at| *at != submodule);
    above.into_iter().any(|at| {
        let name = at.file_stem().unwrap().to_str().unwrap();
        tests_of(at.parent().unwrap()).contains(name)
    })
}

/// Names that a `mod.rs` takes from its submodules, and from which.
fn exports(text: &str) -> BTreeMap<String, String> {
    fn names(tree: &UseTree, first: &str, found: &mut BTreeMap<String, String>) {
        match tree {
            UseTree::Path(path) => names(&path.tree, first, found),
            UseTree::Name(name) => _ = found.insert(name.ident.to_string(), first.to_string()),
            UseTree::Rename(rename) => _ = found.insert(rename.rename.to_string(), first.to_string()),
            UseTree::Group(group) => group.items.iter().for_each(|tree| names(tree, first, found)),
            UseTree::Glob(_) => {}
        }
    }
    let mut found = BTreeMap::new();
    for item in syn::parse_file(text).unwrap().items {
        if let Item::Use(item) = item
            && let UseTree::Path(path) = &item.tree
        {
            names(&path.tree, &path.ident.to_string(), &mut found);
        }
    }
    found
}

/// The circles of a graph: sets of nodes that all reach each other.
fn circles(graph: &BTreeMap<String, BTreeSet<String>>) -> Vec<Vec<String>> {
    let reached = |from: &String| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![from.clone()]);
        while let Some(node) = open.pop() {
            open.extend(graph.get(&node).into_iter().flatten().filter(|next| seen.insert((*next).clone())).cloned());
        }
        seen
    };
    let reached: BTreeMap<&String, BTreeSet<String>> = graph.keys().map(|node| (node, reached(node))).collect();
    let circle = |node: &&String| -> Vec<String> {
        reached[*node].iter().filter(|other| reached[*other].contains(*node)).cloned().collect()
    };
    let found: BTreeSet<Vec<String>> = graph.keys().collect::<Vec<_>>().iter().map(circle).collect();
    found.into_iter().filter(|circle| circle.len() > 1).collect()
}

#[test]
fn no_folder_holds_more_than_a_dozen_files() {
    let mut wrong = Vec::new();
    for folder in folders(&core()) {
        let (name, tests) = (name_in_core(&folder), tests_of(&folder));
        let files = fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path());
        let counted = files
            .filter(|f| f.extension().is_some_and(|e| e == "rs"))
            .filter(|f| !tests.contains(f.file_stem().unwrap().to_str().unwrap()))
            .count();
        if counted > MOST_FILES {
            wrong.push(format!("{name} holds {counted} files, allowed are {MOST_FILES}: divide it by idea"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn submodules_of_a_folder_depend_on_each_other_one_way() {
    let mut wrong = Vec::new();
    for folder in folders(&core()) {
        let name = name_in_core(&folder);
        let graph = submodules(&folder);
        for circle in circles(&graph) {
            let arrows = circle.iter().flat_map(|from| {
                graph[from].iter().filter(|to| circle.contains(to)).map(move |to| format!("{from} -> {to}"))
            });
            wrong.push(format!("{name}: {}", arrows.collect::<Vec<_>>().join(", ")));
        }
    }
    assert!(wrong.is_empty(), "circles:\n{}", wrong.join("\n"));
}

#[test]
fn uses_are_seen_in_paths_trees_and_macros_but_not_in_tests() {
    let text = "
        use super::{b::X, c::{self, Y as Z}};
        pub(in crate::hidden) fn f(x: crate::d::T) { format!(\"{}\", crate::e::g()); }
        mod inner { use super::super::h; }
        #[cfg(test)] mod tests { use crate::i; }
        #[cfg(test)] fn helper() { crate::j::k() }";
    let found = Uses::of(text, ["room", "a"].map(String::from).to_vec());
    let found: Vec<String> = found.iter().map(|path| path.join("::")).collect();
    assert_eq!(found, ["d::T", "e::g", "room::b::X", "room::c", "room::c::Y", "room::h"]);
}

#[test]
fn circles_are_found_and_chains_are_none() {
    let graph = |arrows: &[(&str, &str)]| {
        let mut graph: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (from, to) in arrows {
            graph.entry(to.to_string()).or_default();
            graph.entry(from.to_string()).or_default().insert(to.to_string());
        }
        graph
    };
    assert!(circles(&graph(&[("a", "b"), ("b", "c"), ("a", "c")])).is_empty());
    assert_eq!(circles(&graph(&[("a", "b"), ("b", "c"), ("c", "b"), ("d", "a")])), [["b", "c"]]);
}

#[test]
fn the_example_of_contributing_stands_in_the_code() {
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../CONTRIBUTING.md")).unwrap();
    let code = fs::read_to_string(core().join("recipes/system/height.rs")).unwrap();
    let block = text.split("```rust\n").nth(1).unwrap().split("```").next().unwrap();
    let mut rest: Vec<&str> = code.lines().collect();
    for line in block.lines().filter(|line| !line.is_empty() && !line.contains("// ...")) {
        let at = rest.iter().position(|own| *own == line).unwrap_or_else(|| panic!("not in height.rs: {line}"));
        rest.drain(..=at);
    }
}
