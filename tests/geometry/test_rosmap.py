from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from react_opt.errors import InputError, UsageError
from react_opt.geometry import OccupancyMap, load_map, save_map
from react_opt.geometry.occupancy import FREE, OCCUPIED, UNKNOWN
from react_opt.geometry.rosmap import read_ros_map, write_ros_map

HEAD = {
    "image": "map.pgm",
    "resolution": "0.05",
    "origin": "[0.0, 0.0, 0.0]",
    "negate": "0",
    "occupied_thresh": "0.65",
    "free_thresh": "0.196",
}


def place(folder: Path, picture: bytes | Image.Image, name: str = "map.pgm", /, **changes: str) -> Path:
    """Write an image and its YAML; return the YAML's path."""
    if isinstance(picture, bytes):
        (folder / name).write_bytes(picture)
    else:
        picture.save(folder / name)
    head = HEAD | {"image": name} | changes
    path = folder / "map.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in head.items() if value))
    return path


def pgm(rows: list[list[int]], maxval: int = 255) -> bytes:
    """Return a plain (P2) PGM."""
    text = "\n".join(" ".join(map(str, row)) for row in rows)
    return f"P2\n# a comment\n{len(rows[0])} {len(rows)}\n{maxval}\n{text}\n".encode()


def faults(path: Path) -> list[str]:
    with pytest.raises(InputError) as caught:
        read_ros_map(path)
    return [f"{fault.place}: {fault.message}" for fault in caught.value.faults]


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    cells=st.integers(0, 10_000),
    image_format=st.sampled_from(("pgm", "png")),
    mode=st.sampled_from(("trinary", "scale", "raw")),
    negate=st.booleans(),
)
def test_what_is_written_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, cells: int, image_format: str, mode: str, negate: bool
) -> None:
    rng = np.random.default_rng(cells)
    map_ = OccupancyMap(rng.integers(0, 3, rng.integers(1, 9, 2)).astype(np.uint8), 0.05, -1.5, 2.25, 0.3)
    path = tmp_path_factory.mktemp("maps") / "a map.yaml"
    opaque_scale = mode == "scale" and image_format == "pgm" and bool((map_.cells == UNKNOWN).any())
    if opaque_scale:  # unknown pixels are transparent there
        with pytest.raises(UsageError):
            write_ros_map(map_, path, image_format=image_format, mode=mode, negate=negate)
        return
    write_ros_map(map_, path, image_format=image_format, mode=mode, negate=negate)
    back = load_map(path)
    np.testing.assert_array_equal(back.cells, map_.cells)
    assert (back.resolution_m, back.origin_x_m, back.origin_y_m, back.origin_yaw_rad) == (0.05, -1.5, 2.25, 0.3)
    assert sorted(p.name for p in path.parent.iterdir()) == sorted(("a map.yaml", f"a map.{image_format}"))


def test_shade_205_is_unknown_at_map_savers_threshold_and_free_at_nav2s(tmp_path: Path) -> None:
    # p(205) = 50 / 255 = 0.19608: just not below 0.196, but below 0.25
    picture = pgm([[205, 254, 0]])
    np.testing.assert_array_equal(read_ros_map(place(tmp_path, picture)).cells, [[UNKNOWN, FREE, OCCUPIED]])
    wide = read_ros_map(place(tmp_path, picture, free_thresh="0.25"))
    np.testing.assert_array_equal(wide.cells, [[FREE, FREE, OCCUPIED]])


def test_the_images_last_row_is_the_maps_first(tmp_path: Path) -> None:
    map_ = read_ros_map(place(tmp_path, pgm([[0, 0], [254, 205]])))
    np.testing.assert_array_equal(map_.cells, [[FREE, UNKNOWN], [OCCUPIED, OCCUPIED]])


def test_negate_turns_black_into_free(tmp_path: Path) -> None:
    map_ = read_ros_map(place(tmp_path, pgm([[0, 50, 255]]), negate="1"))
    np.testing.assert_array_equal(map_.cells, [[FREE, UNKNOWN, OCCUPIED]])  # p(50) = 50 / 255


def test_raw_values_are_percent_and_above_100_unknown(tmp_path: Path) -> None:
    map_ = read_ros_map(place(tmp_path, pgm([[0, 19, 20, 65, 66, 100, 101, 255]]), mode="raw"))
    f, u, o = FREE, UNKNOWN, OCCUPIED
    np.testing.assert_array_equal(map_.cells, [[f, f, u, u, o, o, u, u]])


@pytest.mark.parametrize("maxval", [1, 15, 100, 1000, 65535])
def test_other_maxvals_mean_the_same_shades(tmp_path: Path, maxval: int) -> None:
    white, dark = maxval, maxval // 4
    expected = [[FREE, OCCUPIED, OCCUPIED]]  # p = 0, 1 and >= 0.75
    np.testing.assert_array_equal(read_ros_map(place(tmp_path, pgm([[white, 0, dark]], maxval))).cells, expected)
    width = 1 if maxval < 256 else 2
    body = b"".join(v.to_bytes(width, "big") for v in (white, 0, dark))
    binary = f"P5 3 1 {maxval}\n".encode() + body
    np.testing.assert_array_equal(read_ros_map(place(tmp_path, binary)).cells, expected)


def test_sixteen_bits_keep_their_precision(tmp_path: Path) -> None:
    # 0.196 * 65535 = 12844.86: one shade apart, free and unknown, though both are 205 in 8 bits
    shades = np.array([[65535 - 12844, 65535 - 12845]], dtype=np.uint16)
    map_ = read_ros_map(place(tmp_path, Image.fromarray(shades), "map.png"))
    np.testing.assert_array_equal(map_.cells, [[FREE, UNKNOWN]])


def test_colour_alpha_and_palette(tmp_path: Path) -> None:
    grey = Image.fromarray(np.array([[254, 205, 0]], dtype=np.uint8))
    expected = [[FREE, UNKNOWN, OCCUPIED]]
    for mode in ("L", "LA", "RGB", "RGBA", "P", "1"):
        picture = grey.convert(mode)
        wanted = expected if mode != "1" else read_ros_map(place(tmp_path, picture.convert("L"))).cells
        np.testing.assert_array_equal(read_ros_map(place(tmp_path, picture, "map.png")).cells, wanted)
    clear = grey.convert("LA")
    clear.putalpha(Image.fromarray(np.array([[255, 255, 0]], dtype=np.uint8)))
    np.testing.assert_array_equal(read_ros_map(place(tmp_path, clear, "map.png")).cells, [[FREE, UNKNOWN, UNKNOWN]])


def test_numbers_as_ros_writes_them(tmp_path: Path) -> None:
    path = place(tmp_path, pgm([[254]]), resolution="5e-2", origin="[-1e1, 2, 1.5707963]", negate="false", extra="1")
    map_ = read_ros_map(path)
    assert (map_.resolution_m, map_.origin_x_m, map_.origin_yaw_rad) == (0.05, -10.0, 1.5707963)


def test_an_image_elsewhere_is_found_relative_to_the_yaml(tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    assert read_ros_map(place(tmp_path, pgm([[254]]), "images/x.pgm")).cells.shape == (1, 1)


def test_all_faults_at_once(tmp_path: Path) -> None:
    path = place(
        tmp_path,
        pgm([[254]]),
        resolution="-0.05",
        origin="[0, .nan]",
        negate="maybe",
        occupied_thresh="1.5",
        free_thresh="",
        mode="fancy",
    )
    places = {line.split(":")[0] for line in faults(path)}
    assert places == {"resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode"}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"free_thresh": "0.7"}, "free_thresh: expected at most occupied_thresh"),
        ({"origin": "[0, .inf, 0]"}, "origin[1]: expected a finite number"),
        ({"origin": "0"}, "origin: expected [x, y, yaw]"),
        ({"resolution": "fine"}, "resolution: expected metres per pixel"),
        ({"resolution": "0"}, "resolution: expected metres per pixel"),
        ({"image": "[1]"}, "image: expected the path of an image"),
        ({"image": "nowhere.pgm"}, ": the image cannot be read: No such file"),
        ({"image": "map.yaml"}, ": expected an image"),
        ({"image": "."}, ": the image cannot be read"),
    ],
)
def test_each_fault_says_what_was_expected(tmp_path: Path, changes: dict[str, str], expected: str) -> None:
    assert faults(place(tmp_path, pgm([[254]]), **changes))[0].startswith(expected)


@pytest.mark.parametrize(
    "content",
    [b"", b"[1, 2]", b"image: [", b"\xff\xfe\x00", b"a: &a [*a, *a]\n? *a\n: 1", b"[" * 5000, b"x" * 2_000_000],
)
def test_what_is_no_yaml_of_a_map_is_one_clear_fault(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "map.yaml"
    path.write_bytes(content)
    assert len(faults(path)) >= 1


def test_broken_and_oversized_images(tmp_path: Path) -> None:
    for image in (
        b"P5 3 1 255\n\0",
        b"P2 3 1 255\n1 2",
        b"P2 2 1 255\n1 a",
        b"P5 0 5 255\n",
        b"P5 3 1 70000\n",
        b"P5 -3 1 255\n",
        b"P5 90000 90000 255\n",
        b"P5 12000 12000 255\n",
        b"",
        b"\x89PNG\r\n\x1a\n0000",
    ):
        found = faults(place(tmp_path, image))
        assert len(found) == 1, image
        assert "image" in found[0] or "pixels" in found[0], found


def test_a_missing_file_and_an_unknown_suffix(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"No such file"):
        load_map(tmp_path / "none.yaml")
    with pytest.raises(InputError, match=r"expected a map"):
        load_map(tmp_path / "none.bmp")
    with pytest.raises(UsageError):
        save_map(OccupancyMap(np.zeros((1, 1), np.uint8), 1.0), tmp_path / "none.bmp")
    with pytest.raises(InputError, match="cannot be written"):
        save_map(OccupancyMap(np.zeros((1, 1), np.uint8), 1.0), tmp_path / "missing" / "a.yaml")
