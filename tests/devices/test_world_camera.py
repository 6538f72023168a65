"""The virtual depth camera: honest geometry, each term of the sensor model, and speed."""

import time

import numpy as np
import pytest

from eddyscan.core.depth import DepthImage
from eddyscan.core.fiducials import FiducialSheet
from eddyscan.core.frames import apply, invert, transform
from eddyscan.core.parts import PARTS
from eddyscan.devices.protocols import DepthCamera
from eddyscan.devices.sim.camera import VirtualDepthCamera
from eddyscan.devices.sim.camera_raycast import Hits, Raycaster
from eddyscan.devices.sim.sensor import StereoSensor, blobs, gaussian_field
from eddyscan.devices.sim.world_scene import OS30A, PART_SOLID, build_scene, camera_poses
from eddyscan.devices.sim.world_settings import WorldCamera

PERFECT = WorldCamera(
    noise_white_px=0, noise_correlated_px=0, noise_static_px=0, bias_map_px=0, pixel_locking_px=0,
    disparity_step_px=0, edge_fattening=0, edge_flying=0, edge_lost=0, occlusion_lost=1,
    incidence_deg=(89.0, 90.0), highlight_lost=0, holes=0,
)  # fmt: skip
SHAPE = (OS30A.height, OS30A.width)


@pytest.fixture(scope="module")
def scene():
    return build_scene("block-a", seed=5, clutter=4, edge_mm=1.0)


@pytest.fixture(scope="module")
def exact_view(scene):
    camera = VirtualDepthCamera(scene, PERFECT, 5)
    return camera.capture(), camera.true_poses()[0]


def flat_wall(depth_mm=280.0, facing=1.0):
    return Hits(
        np.full(SHAPE, depth_mm, np.float32), np.full(SHAPE, facing, np.float32), np.full(SHAPE, PART_SOLID, np.uint32)
    )


def sensed(options, hits, seed=1, *, metal=False):
    sensor = StereoSensor.made(options, OS30A.fx, SHAPE, 1)
    return sensor.depth(hits, np.full(SHAPE, metal), np.random.default_rng(seed))


def disparity_error(depth, options=PERFECT, depth_mm=280.0):
    return OS30A.fx * options.baseline_mm * (1 / depth - 1 / depth_mm)


class TestGeometry:
    def test_camera_is_a_depth_camera_that_tells_no_pose(self, scene, exact_view):
        assert isinstance(VirtualDepthCamera(scene, PERFECT, 5), DepthCamera)
        assert exact_view[0].T_world_camera is None

    def test_pixels_without_imperfections_lie_on_table_part_and_clutter(self, scene, exact_view):
        image, pose = exact_view
        points = apply(pose, deprojected(image))
        assert points[:, 2].min() > -0.01
        assert (np.abs(points[:, 2]) < 0.01).mean() > 0.5
        high = points[points[:, 2] > 20][::10]
        on_part = np.abs(scene.part.closest(apply(invert(scene.T_table_part), high))[2])
        top = on_part < 0.5
        assert top.sum() > 5_000
        assert np.percentile(on_part[top], 95) < 0.005

    def test_least_range_is_enforced(self, scene):
        near = VirtualDepthCamera(scene, PERFECT.model_copy(update={"range_mm": (280.0, 2500.0)}), 5).capture()
        assert np.nanmin(near.depth_mm) >= 280.0

    def test_what_the_right_camera_cannot_see_is_lost(self, scene, exact_view):
        image, pose = exact_view
        hits = Raycaster(list(scene.meshes)).cast(OS30A, pose)
        hidden = np.isnan(image.depth_mm) & np.isfinite(hits.depth_mm) & (hits.facing > 0.3)
        v, u = np.nonzero(hidden)
        step = max(1, len(u) // 200)
        R, origin = pose[:3, :3], pose[:3, 3]
        right_eye = origin + R @ np.array([PERFECT.baseline_mm, 0.0, 0.0])
        ray = np.stack([(u - OS30A.cx) / OS30A.fx, (v - OS30A.cy) / OS30A.fy, np.ones(len(u))], axis=1)[::step]
        spots = origin + (ray * hits.depth_mm[v, u][::step, None]) @ R.T
        assert blocked_share(scene, right_eye, spots) > 0.9


def deprojected(image: DepthImage):
    v, u = np.nonzero(np.isfinite(image.depth_mm))
    z = image.depth_mm[v, u]
    return np.stack([(u - OS30A.cx) / OS30A.fx * z, (v - OS30A.cy) / OS30A.fy * z, z], axis=1)


def blocked_share(scene, eye, spots):
    import eddyscan.devices.sim.camera_raycast as raycast

    o3d = raycast.load_open3d()
    caster = Raycaster(list(scene.meshes))
    away = spots - eye
    rays = np.concatenate([np.broadcast_to(eye, spots.shape), away], axis=1).astype(np.float32)
    hit = caster._scene.cast_rays(o3d.core.Tensor(np.ascontiguousarray(rays)))["t_hit"].numpy()
    return float((hit < 0.999).mean())


class TestSensorTerms:
    def test_white_noise_is_what_the_option_says_and_frames_average_it(self):
        options = PERFECT.model_copy(update={"noise_white_px": 0.05})
        one = disparity_error(sensed(options, flat_wall()))
        ten = disparity_error(sensed(options.model_copy(update={"frames": 10}), flat_wall()))
        assert one.std() == pytest.approx(0.05, rel=0.02)
        assert ten.std() == pytest.approx(0.05 / np.sqrt(10), rel=0.03)

    def test_static_noise_stays_when_frames_are_averaged(self):
        options = PERFECT.model_copy(update={"noise_static_px": 0.07, "frames": 10})
        assert disparity_error(sensed(options, flat_wall())).std() == pytest.approx(0.07, rel=0.05)

    def test_correlated_noise_spans_the_matching_window(self):
        options = PERFECT.model_copy(update={"noise_correlated_px": 0.07})
        error = disparity_error(sensed(options, flat_wall()))
        near = (error[:, :-1] * error[:, 1:]).mean() / error.var()
        far = (error[:, :-20] * error[:, 20:]).mean() / error.var()
        assert near > 0.9
        assert abs(far) < 0.1

    def test_bias_map_is_the_same_in_all_views(self):
        options = PERFECT.model_copy(update={"bias_map_px": 0.05})
        a = disparity_error(sensed(options, flat_wall(), seed=1))
        b = disparity_error(sensed(options, flat_wall(300.0), seed=2), depth_mm=300.0)
        assert np.abs(a - b).max() < 1e-3
        assert 0.02 < a.std() < 0.08

    def test_steps_of_an_eighth_pixel(self):
        options = PERFECT.model_copy(update={"disparity_step_px": 0.125, "noise_white_px": 0.05})
        disparity = OS30A.fx * options.baseline_mm / sensed(options, flat_wall())
        assert np.abs(disparity / 0.125 - np.round(disparity / 0.125)).max() < 1e-3

    def test_grazing_pixels_fade_and_facing_ones_stay(self):
        options = PERFECT.model_copy(update={"incidence_deg": (60.0, 82.0)})
        lost = [np.isnan(sensed(options, flat_wall(facing=np.cos(np.radians(a))))).mean() for a in (30.0, 71.0, 85.0)]
        assert lost[0] == 0
        assert lost[1] == pytest.approx(0.5, abs=0.03)
        assert lost[2] == 1

    def test_metal_facing_the_lamp_glares(self):
        options = PERFECT.model_copy(update={"highlight_lost": 0.38})
        assert np.isnan(sensed(options, flat_wall(), metal=True)).mean() == pytest.approx(0.38, abs=0.03)
        assert not np.isnan(sensed(options, flat_wall(), metal=False)).any()

    def test_edges_fatten_fly_and_vanish_only_beside_the_jump(self):
        hits = flat_wall()
        hits.depth_mm[:, 600:] = 320.0
        options = PERFECT.model_copy(update={"edge_fattening": 0.38, "edge_flying": 0.18, "edge_lost": 0.1})
        depth = sensed(options, hits)
        band = depth[:, 600:603]
        assert (np.abs(band - 280.0) < 0.1).mean() == pytest.approx(0.38, abs=0.06)
        assert ((band > 280.5) & (band < 319.5)).mean() == pytest.approx(0.18, abs=0.06)
        assert np.abs(np.nan_to_num(depth[:, 620:], nan=320.0) - 320.0).max() < 0.1
        assert np.abs(depth[:, :560] - 280.0).max() < 0.1

    def test_depth_scale_error_scales(self):
        options = PERFECT.model_copy(update={"depth_scale_error": 0.002})
        assert np.nanmean(sensed(options, flat_wall())) == pytest.approx(280.56, abs=0.01)

    @pytest.mark.parametrize("share", [0.0, 0.01, 0.38, 1.0])
    def test_blobs_cover_their_share(self, share):
        covered = blobs(SHAPE, share, 4.0, np.random.default_rng(1)).mean()
        assert covered == pytest.approx(share, abs=0.15 * share + 1e-9)

    @pytest.mark.parametrize("length", [0.0, 3.0, 60.0])
    def test_fields_have_unit_variance(self, length):
        field = gaussian_field((920, 1280), length, np.random.default_rng(2))
        assert field.std() == pytest.approx(1.0, rel=0.25 if length > 10 else 0.05)


class TestInfrared:
    def test_without_a_sheet_there_is_no_picture(self, exact_view):
        assert exact_view[0].intensity is None

    def test_the_sheet_gives_every_view_its_pose(self):
        import cv2

        scene = build_scene("block-a", seed=5, clutter=0, edge_mm=1.0)
        camera = VirtualDepthCamera(scene, WorldCamera(fiducials=True), 5)
        sheet = FiducialSheet()
        detector = cv2.aruco.CharucoDetector(sheet.board())
        K = np.array([[OS30A.fx, 0, OS30A.cx], [0, OS30A.fy, OS30A.cy], [0, 0, 1.0]])
        T_table_sheet = camera._infrared.T_table_sheet
        for image, pose in zip(camera.capture_views(2), camera.true_poses(2), strict=True):
            corners, ids, _, _ = detector.detectBoard(image.intensity)
            assert len(ids) > 20
            points, pixels = sheet.board().matchImagePoints(corners, ids)
            _, turn, shift = cv2.solvePnP(points, pixels, K, None)
            found = transform(cv2.Rodrigues(turn)[0], shift.ravel())
            error = invert(found) @ invert(pose) @ T_table_sheet
            assert np.linalg.norm(error[:3, 3]) < 0.5
            assert np.degrees(np.arccos(np.clip((np.trace(error[:3, :3]) - 1) / 2, -1, 1))) < 0.2


class TestPoses:
    @pytest.mark.parametrize("part", sorted(PARTS))
    def test_every_view_holds_most_of_the_part_beyond_the_least_range(self, part):
        scene = build_scene(part, seed=2, clutter=4, edge_mm=4.0)
        top = apply(scene.T_table_part, scene.part.top_mesh(4.0).vertices)
        for seed in range(5):
            for pose in camera_poses(scene, WorldCamera(), 5, np.random.default_rng(seed)):
                seen = apply(invert(pose), top)
                u = OS30A.fx * seen[:, 0] / seen[:, 2] + OS30A.cx
                v = OS30A.fy * seen[:, 1] / seen[:, 2] + OS30A.cy
                inside = (u > 0) & (u < OS30A.width) & (v > 0) & (v < OS30A.height) & (seen[:, 2] > 200)
                assert inside.mean() > 0.85

    def test_pose_sets_differ_between_seeds_and_repeat_for_one(self, scene):
        camera = VirtualDepthCamera(scene, WorldCamera(), 5)
        first, again, other = camera.true_poses(5, 7), camera.true_poses(5, 7), camera.true_poses(5, 8)
        assert np.array_equal(first, again)
        assert not np.allclose(first, other)

    def test_tilt_is_within_its_limits(self, scene):
        for pose in VirtualDepthCamera(scene, WorldCamera(), 5).true_poses(60, 3):
            assert 20.0 <= np.degrees(np.arccos(-pose[2, 2])) <= 50.0

    def test_clutter_stands_clear_of_the_part_and_can_be_left_out(self):
        bare = build_scene("block-a", seed=1, clutter=0, edge_mm=4.0)
        full = build_scene("block-a", seed=1, clutter=4, edge_mm=4.0)
        assert len(bare.meshes) == 2
        assert len(full.meshes) == 6
        for mesh in full.meshes[2:]:
            at = apply(invert(full.T_table_part), mesh.vertices)
            outside = np.maximum(np.maximum(-at[:, :2], at[:, :2] - [200, 100]), 0)
            assert np.hypot(*outside.T).min() > 5.0


def test_views_repeat_for_a_seed_and_cost_well_under_a_second_each(scene):
    camera = VirtualDepthCamera(scene, WorldCamera(), 5)
    first = camera.capture_views(2, seed=4)[0]
    before = time.process_time()
    views = camera.capture_views(2, seed=4)
    assert (time.process_time() - before) / 2 < 1.5
    np.testing.assert_array_equal(first.depth_mm, views[0].depth_mm)
    assert not np.array_equal(views[0].depth_mm, views[1].depth_mm, equal_nan=True)
