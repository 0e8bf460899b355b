"""The layout is the architecture: a package is one subject and imports only packages below it."""

import ast
import importlib
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import cvtimg

PACKAGE = Path(cvtimg.__file__).parent

#: From the lowest to the highest; packages of one layer do not import each other.
LAYERS: list[set[str]] = [
    {"_shared"},
    {"files"},
    {"blocks"},
    {"engine", "pictures", "batch"},
    {"colors", "tables", "labels"},
    {"elbow", "looks", "palettes", "placement", "halfedges"},
    {"quantization", "segmentation", "bases"},
    {"restoration", "plotting", "designs", "artwork", "meshes", "sphere"},
    {"supports", "surfaces"},
    {"options"},
    {"explore"},
    {"cli"},
    {"__main__"},
]
RANK = {name: rank for rank, layer in enumerate(LAYERS) for name in layer}
MODULES = {
    ".".join(path.relative_to(PACKAGE).with_suffix("").parts).removesuffix(".__init__"): path
    for path in PACKAGE.rglob("*.py")
    if path != PACKAGE / "__init__.py"
}
#: What a name of the first ring comes from.
FACES = {
    alias.name: node.module
    for node in ast.parse((PACKAGE / "__init__.pyi").read_text()).body
    if isinstance(node, ast.ImportFrom) and node.module
    for alias in node.names
}


def imported(tree: ast.Module) -> set[str]:
    """Return the modules of cvtimg that a module imports, at its top or in a function."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "cvtimg":
            base = (node.module or "").removeprefix("cvtimg").removeprefix(".")
            for alias in node.names:
                name = f"{base}.{alias.name}" if base else FACES.get(alias.name, alias.name)
                found.add(name if name in MODULES or not base else base)
        elif isinstance(node, ast.Import):
            found |= {alias.name.removeprefix("cvtimg.") for alias in node.names if alias.name.startswith("cvtimg.")}
    return found


def package(module: str) -> str:
    return module.split(".")[0]


@pytest.fixture(scope="module")
def trees() -> dict[str, ast.Module]:
    return {name: ast.parse(path.read_text()) for name, path in MODULES.items()}


@pytest.fixture(scope="module")
def imports(trees: dict[str, ast.Module]) -> dict[str, set[str]]:
    return {name: imported(tree) for name, tree in trees.items()}


def test_a_package_imports_only_packages_below_it(imports: dict[str, set[str]]) -> None:
    upward = {
        f"{name} imports {other}"
        for name, others in imports.items()
        for other in others
        if package(other) != package(name) and RANK[package(other)] >= RANK[package(name)]
    }
    assert upward == set()


def test_modules_do_not_import_each_other_in_circles(imports: dict[str, set[str]]) -> None:
    # A package's face imports lazily, so it closes no circle.
    graph = {name: others - {package(name)} for name, others in imports.items()}
    TopologicalSorter(graph).prepare()


def test_no_module_is_named_like_a_public_function() -> None:
    public = {name for stub in PACKAGE.rglob("__init__.pyi") for name in listed(stub) if name not in RANK}
    modules = {name.rpartition(".")[2] for name in MODULES}
    assert public & modules == set()


def listed(stub: Path) -> set[str]:
    """Return the names that the face of a package imports."""
    nodes = [node for node in ast.parse(stub.read_text()).body if isinstance(node, ast.ImportFrom)]
    return {alias.asname or alias.name for node in nodes for alias in node.names}


def test_a_face_lists_all_that_it_imports_and_each_name_is_there() -> None:
    for stub in PACKAGE.rglob("__init__.pyi"):
        name = ".".join(["cvtimg", *stub.parent.relative_to(PACKAGE).parts])
        module = importlib.import_module(name)
        assert sorted(module.__all__) == sorted(listed(stub)), name
        for public in listed(stub) - {"CVT"}:
            assert getattr(module, public) is not None, f"{name}.{public}"


def is_number(node: ast.expr | None) -> bool:
    """Whether an expression is made of numbers alone, as ``1 << 20`` and ``(256, 1024)`` are."""
    parts = [] if node is None else [part for part in ast.walk(node) if isinstance(part, ast.expr)]
    constants = [part.value for part in parts if isinstance(part, ast.Constant)]
    others = [part for part in parts if not isinstance(part, (ast.Constant, ast.Tuple, ast.BinOp, ast.UnaryOp))]
    return bool(constants) and not others and all(type(value) in (int, float) for value in constants)


def test_few_constants_are_numbers_and_few_parameters_are_the_most(trees: dict[str, ast.Module]) -> None:
    # What only its author could fit, nobody can maintain.
    constants = [node for tree in trees.values() for node in tree.body if isinstance(node, (ast.Assign, ast.AnnAssign))]
    assert sum(is_number(node.value) for node in constants) <= 620
    functions = [node.args for tree in trees.values() for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    assert max(len([*one.posonlyargs, *one.args, *one.kwonlyargs]) for one in functions) <= 17
