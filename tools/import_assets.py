"""Rebuild `assets/` from the two published wheels that hold the NeuroMechFly model.

    python tools/import_assets.py            # download, check, write assets/
    python tools/import_assets.py --check    # write nothing; fail if assets/ would change

Needs the dependency group "assets". The wheels are named by version and SHA-256 below, so the same
bytes go in and the same bytes come out. flyrl itself never runs this and never reads a pickle: the
recorded steps are unpickled here, by an unpickler that knows NumPy arrays and nothing else.

Sources: NeuroMechFly (Lobato-Rios et al. 2022, doi:10.1038/s41592-022-01466-7) and NeuroMechFly v2
(Wang-Chen et al. 2024, doi:10.1038/s41592-024-02497-y), Apache-2.0.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import json
import pickle
import re
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import fast_simplification
import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares
from scipy.spatial import ConvexHull

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from flyrl.anatomy import JOINTS, LEG_DOFS, LEG_SEGMENTS, LEGS, PASSIVE_TARSUS_JOINTS  # noqa: E402

Array = NDArray[np.float64]
Files = dict[str, bytes]
"""Path below assets/ -> content."""


# --------------------------------------------------------------------------- what is imported


@dataclass(frozen=True)
class Source:
    """One published body, the wheel it comes from, and what that package's code sets on it.

    Values that the package's model file leaves at a placeholder and its code fills in are given
    here, with the place they were read from. `None` keeps the model file's own figure.
    """

    name: str
    version: str
    sha256: str
    mjcf: str
    steps: str
    steps_name: str
    neutral_phase: float
    kp: float
    force_range: tuple[float, float] | None
    leg_joint: tuple[float, float]
    tarsus_joint: tuple[float, float]
    neck_joint: tuple[float, float] | None
    other_joint: tuple[float, float] | None
    adhesion_gain: float = 40.0

    @property
    def wheel(self) -> str:
        """File name of the wheel."""
        return f"flygym-{self.version}-py3-none-any.whl"


SOURCES = (
    Source(
        name="classic",
        version="0.2.5",
        sha256="fb365ac8b17e2f62fe1dc70e78900f7136b198a0e06b91aee79e1f4dd7c51727",
        mjcf="flygym/data/mjcf/groundwalking_nmf_mjcf_nofloor_230518__bendTarsus_scaled.xml",
        steps="flygym/data/behavior/single_steps.pkl",
        steps_name="tethered",
        neutral_phase=0.0,
        # class Parameters in flygym/mujoco/core.py. Neck and antennae keep the model file's
        # figures: there is no code for them.
        kp=30.0,
        force_range=None,
        leg_joint=(0.05, 0.06),
        tarsus_joint=(2.2, 0.05),
        neck_joint=None,
        other_joint=None,
    ),
    Source(
        name="current",
        version="1.2.1",
        sha256="5db9bb89b7f57e2fda8d716fd8205b0ba7ac9a46e7c194ea6e752e38964f390d",
        mjcf="flygym/data/mjcf/neuromechfly_seqik_kinorder_ypr.xml",
        steps="flygym/data/behavior/single_steps_untethered.pkl",
        steps_name="untethered",
        neutral_phase=float(np.pi),
        # default arguments of class Fly in flygym/fly.py
        kp=45.0,
        force_range=(-65.0, 65.0),
        leg_joint=(0.05, 0.06),
        tarsus_joint=(7.5, 0.01),
        neck_joint=(10.0, 1.0),
        other_joint=(1.0, 1.0),
    ),
)

NECK_JOINTS = ("joint_Head", "joint_Head_roll", "joint_Head_yaw")
POSE = "flygym/data/pose/pose_stretch.yaml"
MESH_FOLDER = "flygym/data/mesh"
METRES_TO_MM = 1000.0

MESH_TRIANGLES = {
    "Thorax": 2600,
    "A1A2": 900,
    "A3": 800,
    "A4": 800,
    "A5": 800,
    "A6": 900,
    "Head": 3200,
    "Eye": 1800,
    "Rostrum": 800,
    "Haustellum": 900,
    "Pedicel": 500,
    "Funiculus": 400,
    "Arista": 600,
    "Wing": 1600,
    "Haltere": 400,
    "Coxa": 600,
    "Femur": 600,
    "Tibia": 500,
    "Tarsus": 240,
}
"""Triangles kept per mesh, by the ending of its name."""

HULL_VERTICES = 12
"""Per collision hull; with more, the fly walks the same and slower."""

REFERENCE_PHASES = 20


# --------------------------------------------------------------------------- wheels and pickles


def download(source: Source, folder: Path) -> zipfile.ZipFile:
    """Fetch the wheel of `source` with pip and open it, after comparing its hash."""
    subprocess.run(
        [
            *(sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"),
            *("--no-deps", "--only-binary=:all:", "--ignore-requires-python"),
            *("--dest", str(folder), f"flygym=={source.version}"),
        ],
        check=True,
    )
    path = folder / source.wheel
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    if digest != source.sha256:
        raise ValueError(f"{source.wheel}: sha256 is {digest}, expected {source.sha256}")
    return zipfile.ZipFile(path)


class ArrayUnpickler(pickle.Unpickler):
    """Reads built-in containers and NumPy arrays; anything else is refused."""

    ALLOWED = frozenset(
        (f"numpy.{core}.multiarray", name)
        for core in ("core", "_core")
        for name in ("_reconstruct", "scalar")
    ) | {("numpy", "ndarray"), ("numpy", "dtype")}

    def find_class(self, module: str, name: str) -> Any:
        """Return the named object if it is one of NumPy's array parts."""
        if (module, name) not in self.ALLOWED:
            raise pickle.UnpicklingError(f"{module}.{name} is not part of a NumPy array")
        return super().find_class(module.replace("numpy.core", "numpy._core"), name)


# --------------------------------------------------------------------------- deterministic output


def figures(values: Any, digits: int = 10) -> list[float]:
    """Values rounded to `digits` significant digits, with -0.0 written as 0.0."""
    return [float(f"{value:.{digits}g}") + 0.0 for value in np.ravel(values)]


def to_json(content: dict[str, Any]) -> bytes:
    """JSON with one line per list item, so that a body reads as one line of a table."""
    parts = []
    for key, value in content.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            rows = ",\n".join("    " + json.dumps(row) for row in value)
            parts.append(f'  "{key}": [\n{rows}\n  ]')
        elif isinstance(value, dict):
            rows = ",\n".join(f"    {json.dumps(k)}: {json.dumps(v)}" for k, v in value.items())
            parts.append(f'  "{key}": {{\n{rows}\n  }}')
        else:
            parts.append(f'  "{key}": {json.dumps(value)}')
    return ("{\n" + ",\n".join(parts) + "\n}\n").encode()


def to_npz(arrays: dict[str, Any]) -> bytes:
    """An uncompressed .npz whose bytes do not depend on the clock."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, array in arrays.items():
            member = io.BytesIO()
            np.lib.format.write_array(member, np.asarray(array, order="C"), allow_pickle=False)
            info = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            archive.writestr(info, member.getvalue())
    return buffer.getvalue()


# --------------------------------------------------------------------------- meshes


def read_stl(content: bytes) -> Array:
    """Triangle corners of a binary STL, shape (n, 3, 3), in the file's unit."""
    count = int.from_bytes(content[80:84], "little")
    records = np.frombuffer(content, np.uint8, offset=84).reshape(count, 50)
    corners = records[:, 12:48].copy().view("<f4").reshape(count, 3, 3)
    return corners.astype(np.float64)


def to_stl(vertices: Array, faces: NDArray[np.int64]) -> bytes:
    """A binary STL with unit normals."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0)
    records = np.zeros((len(faces), 50), np.uint8)
    block = np.concatenate([normals[:, None], corners], axis=1).astype("<f4")
    records[:, :48] = np.ascontiguousarray(block.reshape(len(faces), 12)).view(np.uint8)
    header = b"flyrl: decimated NeuroMechFly mesh, mm".ljust(80, b" ")
    return header + len(faces).to_bytes(4, "little") + records.tobytes()


def decimate(corners: Array, triangles: int) -> tuple[Array, NDArray[np.int64]]:
    """Vertices and faces of the surface, reduced to about `triangles` by quadric collapse."""
    vertices, inverse = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = inverse.reshape(-1, 3).astype(np.int32)
    if len(faces) > triangles:
        points, kept = fast_simplification.simplify(
            vertices.astype(np.float32), faces, target_count=triangles
        )
    else:
        points, kept = vertices, faces
    result = np.asarray(points, np.float64), np.asarray(kept, np.int64)
    return drop_degenerate(*result)


def drop_degenerate(vertices: Array, faces: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Leave out the triangles that the collapse reduced to a line or a point."""
    corners = vertices[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return vertices, faces[area > 1e-9]


def import_meshes(wheel: zipfile.ZipFile, names: list[str]) -> Files:
    """Decimated meshes in mm, one per name; only right and middle ones exist."""
    files: Files = {}
    for name in names:
        corners = read_stl(wheel.read(f"{MESH_FOLDER}/{name}.stl")) * METRES_TO_MM
        ending = max((key for key in MESH_TRIANGLES if key in name), key=len)
        files[f"meshes/{name}.stl"] = to_stl(*decimate(corners, MESH_TRIANGLES[ending]))
    return files


# --------------------------------------------------------------------------- collision shapes


def sphere_directions(count: int = 4000) -> Array:
    """Unit vectors spread evenly over the sphere (golden spiral), shape (count, 3)."""
    steps = np.arange(count) + 0.5
    polar = np.arccos(1 - 2 * steps / count)
    azimuth = np.pi * (1 + np.sqrt(5)) * steps
    return np.stack(
        [np.cos(azimuth) * np.sin(polar), np.sin(azimuth) * np.sin(polar), np.cos(polar)], axis=1
    )


def coarse_hull(points: Array, count: int = HULL_VERTICES) -> Array:
    """Vertices of a convex shape inside the convex hull of `points` and close to it.

    Starts with the extreme points along the axes of the body's frame; then takes, one by one, the
    point that lies furthest outside the hull of those it has.

    Parameters
    ----------
    points : (n, 3) mesh vertices, mm.
    count : how many vertices the shape has.

    Returns
    -------
    (count, 3) of `points`, mm.
    """
    corners: Array = points[ConvexHull(points).vertices]
    chosen = list(np.unique([*corners.argmin(axis=0), *corners.argmax(axis=0)]))
    while len(chosen) < count:
        planes = ConvexHull(corners[chosen]).equations
        outside = (corners @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        chosen.append(int(outside.argmax()))
    vertices: Array = corners[chosen]
    return vertices


def fit_capsule(points: Array) -> tuple[Array, Array, float]:
    """Capsule that meets planes where the convex hull of `points` meets them.

    The published models collide the convex hull of each mesh, so what counts is how far the shape
    reaches in each direction (its support function). The fit is least squares over directions
    spread evenly on the sphere; the ends are then moved along the axis so that the capsule is
    exactly as long as the mesh.

    Parameters
    ----------
    points : (n, 3) mesh vertices, mm.

    Returns
    -------
    start, end : (3,) centres of the two caps, mm; `start` is the end nearer to the origin.
    radius : mm.
    """
    wanted = reach(points)

    def difference(parameters: Array) -> Array:
        result: Array = reach(parameters[:6].reshape(2, 3)) + parameters[6] - wanted
        return result

    centre = points.mean(axis=0)
    axis = np.linalg.svd(points - centre, full_matrices=False)[2][0]
    along = (points - centre) @ axis
    radius = float(np.median(np.linalg.norm(points - centre - np.outer(along, axis), axis=1)))
    ends = centre + np.outer([along.min() + radius, along.max() - radius], axis)
    found = least_squares(difference, np.append(ends.ravel(), radius), xtol=1e-12, ftol=1e-12).x
    ends, radius = found[:6].reshape(2, 3), float(found[6])

    axis = ends[1] - ends[0]
    axis /= np.linalg.norm(axis)
    ends[0] += axis * ((points @ axis).min() + radius - ends[0] @ axis)
    ends[1] += axis * ((points @ axis).max() - radius - ends[1] @ axis)
    if np.linalg.norm(ends[1]) < np.linalg.norm(ends[0]):
        ends = ends[::-1]
    ends = np.round(ends, 6)
    return ends[0], ends[1], round(radius, 6)


def reach(points: Array) -> Array:
    """How far points reach in each of `sphere_directions` (their support function), mm."""
    result: Array = (points @ sphere_directions().T).max(axis=0)
    return result


def fit_errors(difference: Array) -> dict[str, float]:
    """Root mean square and largest difference in reach, mm."""
    rms, worst = np.sqrt(np.mean(difference**2)), np.abs(difference).max()
    return {"fit_rms": round(float(rms), 4), "fit_worst": round(float(worst), 4)}


def import_collision(wheel: zipfile.ZipFile) -> Files:
    """Capsules and coarse hulls of the 24 leg segments of the right side."""
    rows: list[dict[str, Any]] = []
    for position in "FMH":
        for segment in LEG_SEGMENTS:
            name = f"R{position}{segment}"
            corners = read_stl(wheel.read(f"{MESH_FOLDER}/{name}.stl")) * METRES_TO_MM
            points = np.unique(corners.reshape(-1, 3), axis=0)
            start, end, radius = fit_capsule(points)
            capsule = {"from": figures(start), "to": figures(end), "radius": radius}
            hull = np.round(coarse_hull(points), 6)
            rows.append(
                {
                    "segment": name,
                    "capsule": capsule
                    | fit_errors(reach(np.stack([start, end])) + radius - reach(points)),
                    "hull": {"vertices": [figures(vertex) for vertex in hull]}
                    | fit_errors(reach(hull) - reach(points)),
                }
            )
    table = {
        "schema": "flyrl.collision/2",
        "about": "Collision shapes of the right leg segments in the frame of their body, mm; left "
        "ones are reflections. fit_rms, fit_worst: difference in reach (support function) from the "
        "convex hull of the published mesh.",
        "segments": rows,
    }
    return {"collision/legs.json": to_json(table)}


# --------------------------------------------------------------------------- bodies


def published_model(wheel: zipfile.ZipFile, source: Source) -> mujoco.MjModel:
    """The published model, compiled as it is; only names that MuJoCo 4 dropped are replaced.

    Rigidly attached bodies are not fused, so that every named body can be read off.
    """
    text = wheel.read(source.mjcf).decode()
    for old, new in (
        ("mpr_iterations", "ccd_iterations"),
        (' convexhull="true"', ""),
        ('fusestatic="true"', 'fusestatic="false"'),
        (' meaninertia="1.0"', ""),
        ("../mesh/", ""),
    ):
        text = text.replace(old, new)
    meshes = {
        PurePosixPath(name).name: wheel.read(name)
        for name in wheel.namelist()
        if name.startswith(MESH_FOLDER) and name.endswith(".stl")
    }
    model: mujoco.MjModel = mujoco.MjModel.from_xml_string(text, meshes)
    return model


def joint_spring(source: Source, joint: str, model: mujoco.MjModel) -> tuple[float, float]:
    """Stiffness and damping that `joint` has in the published simulation.

    In the classic package, joints that nobody drives keep a position servo that holds them at 0: a
    spring of its gain, so it is counted as one.
    """
    special: tuple[float, float] | None = source.other_joint
    if joint in JOINTS:
        special = source.leg_joint
    elif joint in PASSIVE_TARSUS_JOINTS:
        special = source.tarsus_joint
    elif joint in NECK_JOINTS:
        special = source.neck_joint
    if special is not None:
        return special
    index = model.joint(joint).id
    stiffness = float(model.jnt_stiffness[index].item())
    for actuator in range(model.nu):
        gain, bias = model.actuator_gainprm[actuator], model.actuator_biasprm[actuator]
        if model.actuator_trnid[actuator, 0] == index and bias[1] != 0:
            assert gain[0] == -bias[1]
            assert bias[2] == 0
            stiffness += float(gain[0])
    return stiffness, float(model.dof_damping[model.jnt_dofadr[index]].item())


def mesh_entry(model: mujoco.MjModel, text: str, geom: int) -> dict[str, Any]:
    """Mesh of a geom: its file, and whether the file shows the other side of the fly."""
    mesh = model.geom_dataid[geom]
    name = model.mesh(mesh).name
    found = re.search(rf'<mesh name="{name}"[^>]*file="../mesh/(\w+).stl"', text)
    assert found is not None
    # Compiling moved mesh and geom alike into the mesh's inertial frame. So the file's frame is the
    # body's frame, and the table needs no pose. (The classic file has offsets below 1e-6 mm.)
    assert np.allclose(model.geom_pos[geom], model.mesh_pos[mesh], atol=1e-5)
    assert abs(model.geom_quat[geom] @ model.mesh_quat[mesh]) > 1 - 1e-9
    is_left = name.startswith("mesh_L")
    file = found.group(1)
    return {"file": f"R{file[1:]}" if is_left else file, "mirrored": is_left}


def body_rows(wheel: zipfile.ZipFile, source: Source) -> list[dict[str, Any]]:
    """One row per body from the thorax down, parents before children."""
    model = published_model(wheel, source)
    text = wheel.read(source.mjcf).decode()
    # The table has no columns for these; they are all at their plain value.
    assert not model.jnt_limited.any()
    assert not model.dof_armature.any()
    assert not model.dof_frictionloss.any()
    assert not model.qpos_spring.any()
    rows = []
    for body in range(model.body("Thorax").id, model.nbody):
        joints = []
        for joint in range(
            model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]
        ):
            name = model.joint(joint).name
            stiffness, damping = joint_spring(source, name, model)
            joints.append(
                {
                    "name": name,
                    "axis": figures(model.jnt_axis[joint]),
                    "pos": figures(model.jnt_pos[joint]),
                    "stiffness": stiffness,
                    "damping": damping,
                }
            )
        geoms = [
            geom
            for geom in range(
                model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body]
            )
            if not model.geom(geom).name.endswith("_collision")
        ]
        is_root = model.body(body).name == "Thorax"
        rows.append(
            {
                "name": model.body(body).name,
                "parent": None if is_root else model.body(model.body_parentid[body]).name,
                "pos": figures([0, 0, 0] if is_root else model.body_pos[body]),
                "quat": figures(model.body_quat[body]),
                "mass": figures(model.body_mass[body])[0],
                "ipos": figures(model.body_ipos[body]),
                "iquat": figures(model.body_iquat[body]),
                "inertia": figures(model.body_inertia[body]),
                "joints": joints,
                "mesh": mesh_entry(model, text, geoms[0]) if geoms else None,
            }
        )
    return rows


def import_body(wheel: zipfile.ZipFile, source: Source) -> Files:
    """The readable table of one body."""
    model = published_model(wheel, source)
    thorax = model.body("Thorax").id
    assert np.array_equal(model.body_quat[thorax], [1, 0, 0, 0])
    first_coxa = [name for name in joint_order(model) if name.startswith("joint_LFCoxa")]
    order = [name.removeprefix("joint_LFCoxa").lstrip("_") or "pitch" for name in first_coxa]
    table = {
        "schema": "flyrl.body/1",
        "name": source.name,
        "source": {
            "package": f"flygym {source.version}",
            "sha256": source.sha256,
            "file": source.mjcf,
        },
        "units": "mm, g, s, rad; quaternions w x y z",
        "coxa_joint_order": order,
        "recorded_step": source.steps_name,
        "thorax_in_spawn_frame": figures(model.body_pos[thorax]),
        "actuators": {
            "kp": source.kp,
            "force_range": source.force_range,
            "adhesion_gain": source.adhesion_gain,
        },
        "bodies": body_rows(wheel, source),
    }
    return {f"bodies/{source.name}.json": to_json(table)}


def joint_order(model: mujoco.MjModel) -> list[str]:
    """Joint names in the order of the compiled model."""
    return [model.joint(index).name for index in range(model.njnt)]


# --------------------------------------------------------------------------- steps, pose, reference


def read_steps(wheel: zipfile.ZipFile, source: Source) -> dict[str, Any]:
    """Recorded step as arrays: angles (6, 7, N) rad, times in s."""
    data = ArrayUnpickler(io.BytesIO(wheel.read(source.steps))).load()
    times = data["swing_stance_time"]
    return {
        "angles": np.array(
            [[data[f"joint_{leg}{dof}"] for dof in LEG_DOFS] for leg in LEGS], np.float64
        ),
        "timestep": np.float64(data["meta"]["timestep"]),
        "swing_start_s": np.array([times["swing"][leg] for leg in LEGS], np.float64),
        "stance_start_s": np.array([times["stance"][leg] for leg in LEGS], np.float64),
        "neutral_phase": np.float64(source.neutral_phase),
    }


def import_pose(wheel: zipfile.ZipFile) -> Files:
    """The starting pose, degrees, in the order of anatomy.JOINTS."""
    found = dict(re.findall(r"^\s+(joint_\w+):\s*(-?[\d.]+)\s*$", wheel.read(POSE).decode(), re.M))
    angles = {joint: float(found[joint]) for joint in JOINTS}
    assert set(found) == set(JOINTS)
    return {
        "poses/stretch.json": to_json(
            {
                "schema": "flyrl.pose/1",
                "about": "Legs stretched sideways, so that none starts inside the ground. Degrees.",
                "angles": angles,
            }
        )
    }


def import_reference(wheel: zipfile.ZipFile, source: Source) -> Files:
    """End-effector positions that the published model gives over its recorded step.

    Columns: leg, phase (rad), and the origin of Tarsus5 in the thorax frame (mm).
    """
    model = published_model(wheel, source)
    data = mujoco.MjData(model)
    angles = read_steps(wheel, source)["angles"]
    grid = np.linspace(0, 2 * np.pi, angles.shape[-1])
    thorax = data.body("Thorax")
    lines = ["leg,phase_rad,x,y,z"]
    for leg, recorded in zip(LEGS, angles, strict=True):
        spline = CubicSpline(grid, recorded, axis=1, bc_type="periodic")
        for phase in np.arange(REFERENCE_PHASES) * (2 * np.pi / REFERENCE_PHASES):
            mujoco.mj_resetData(model, data)
            for dof, angle in zip(LEG_DOFS, spline(phase), strict=True):
                data.joint(f"joint_{leg}{dof}").qpos = angle
            mujoco.mj_kinematics(model, data)
            rotation = thorax.xmat.reshape(3, 3)
            point = (data.body(f"{leg}Tarsus5").xpos - thorax.xpos) @ rotation
            lines.append(f"{leg},{phase:.9f}," + ",".join(f"{value:.6f}" for value in point))
    text = "\n".join(lines) + "\n"
    return {f"reference/forward_kinematics_{source.name}.csv": text.encode()}


# --------------------------------------------------------------------------- all of it


def build() -> Files:
    """Everything the script writes, path below assets/ -> content."""
    files: Files = {}
    with tempfile.TemporaryDirectory() as folder:
        for source in SOURCES:
            wheel = download(source, Path(folder))
            files |= import_body(wheel, source)
            files |= import_reference(wheel, source)
            files[f"steps/{source.steps_name}.npz"] = to_npz(read_steps(wheel, source))
            if source.name == "current":
                bodies = json.loads(files["bodies/current.json"])["bodies"]
                meshes = {row["mesh"]["file"] for row in bodies if row["mesh"]}
                files |= import_meshes(wheel, sorted(meshes))
                files |= import_collision(wheel)
                files |= import_pose(wheel)
    return files


def main() -> None:
    """Write assets/, or compare with it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--check", action="store_true", help="compare, write nothing")
    check = parser.parse_args().check
    assets = ROOT / "assets"
    files = build()
    changed = []
    for name, content in sorted(files.items()):
        path = assets / name
        if path.is_file() and path.read_bytes() == content:
            continue
        changed.append(name)
        if not check:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
    for row in json.loads(files["collision/legs.json"])["segments"]:
        for shape in ("capsule", "hull"):
            rms, worst = row[shape]["fit_rms"], row[shape]["fit_worst"]
            print(
                f"{row['segment']:10} {shape:7} reach off by {rms:.4f} mm rms, {worst:.4f} at most"
            )
    size = sum(map(len, files.values())) / 1e6
    print(f"{len(files)} files, {size:.2f} MB, {len(changed)} changed")
    if check and changed:
        sys.exit("assets/ differs from what the wheels give: " + ", ".join(changed))


if __name__ == "__main__":
    main()
