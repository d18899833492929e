#include "smartsurf/view/model/Camera.h"
#include "smartsurf/view/model/TableBounds.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace smartsurf::view {
namespace {

constexpr double kAspects[] = {0.4, 1.0, 4.0 / 3.0, 16.0 / 9.0, 3.2};
constexpr CameraPreset kPresets[] = {CameraPreset::kTop, CameraPreset::kIso, CameraPreset::kSide};

scene::SurfaceSpec make_surface(int rows, int columns) {
  scene::SurfaceSpec s;
  s.rows = rows;
  s.columns = columns;
  return s;
}

// The largest |x| and |y| in normalised device coordinates over the corners of the table and its board.
Eigen::Vector2d max_clip_extent(const Camera& camera, const scene::SurfaceSpec& s, double aspect) {
  const Eigen::AlignedBox3d box = surface_bounding_box(s);
  Eigen::Vector2d extent(0.0, 0.0);
  const double margin = 0.6 * s.pitch;
  for (int i = 0; i < 8; ++i) {
    const double outset = (i & 4) ? 0.0 : margin;
    const Eigen::Vector3d corner((i & 1) ? box.max().x() + outset : box.min().x() - outset,
                                 (i & 2) ? box.max().y() + outset : box.min().y() - outset,
                                 (i & 4) ? box.max().z() : box.min().z());
    const Eigen::Vector4d clip =
        camera.projection_matrix(aspect) * camera.view_matrix() * corner.homogeneous();
    EXPECT_GT(clip.w(), 0.0);
    EXPECT_LT(std::abs(clip.z()), clip.w()) << "cut by a clipping plane";
    extent = extent.cwiseMax(clip.head<2>().cwiseAbs() / clip.w());
  }
  return extent;
}

TEST(Camera, FitsTableWithSmallMarginAtAnyAspect) {
  for (const auto& s : {make_surface(64, 64), make_surface(16, 200), make_surface(200, 16),
                        make_surface(16, 16), make_surface(4, 4)})
    for (double aspect : kAspects)
      for (CameraPreset preset : kPresets) {
        const double reach = max_clip_extent(Camera::fit_to_surface(s, preset, aspect), s, aspect).maxCoeff();
        EXPECT_LT(reach, 1.0);
        EXPECT_GT(reach, 0.85) << "the table is smaller than it could be";
      }
}

TEST(Camera, GoesFartherAwayForObjectsThatWouldBeCutOffAlone) {
  const scene::SurfaceSpec s = make_surface(24, 24);
  scene::Snapshot snapshot;
  snapshot.id = {0, 1, 2};
  snapshot.position = {{12.0F, 23.0F, 9.0F}, {-80.0F, 0.0F, 0.0F}, {12.0F, 12.0F, 1e4F}};
  snapshot.orientation.assign(3, {0.0F, 0.0F, 0.3826834F, 0.9238795F});  // 45° about z
  std::vector<scene::ObjectSpec> catalogue(3);
  catalogue[0].shape = scene::ShapeKind::kBox;
  catalogue[0].size = {4.0, 2.0, 6.0};
  const auto corners = corners_of_objects_over(s, snapshot, catalogue);
  ASSERT_EQ(corners.size(), 8U);  // neither what lies beside the table nor what has flown away
  EXPECT_TRUE(
      corners[0].isApprox(Eigen::Vector3d(12.0 - std::sqrt(0.5), 23.0 - 3.0 * std::sqrt(0.5), 6.0), 1e-6));
  const auto outside = [&](const Camera& camera) {
    return std::ranges::count_if(corners, [&](const Eigen::Vector3d& corner) {
      const Eigen::Vector3d pixel = camera.project(corner, 800.0, 500.0);
      return pixel.x() < 0.0 || pixel.x() > 800.0 || pixel.y() < 0.0 || pixel.y() > 500.0;
    });
  };
  for (CameraPreset preset : kPresets) {
    const Camera table = Camera::fit_to_surface(s, preset, 1.6);
    const Camera all = Camera::fit_to_surface(s, preset, 1.6, corners);
    EXPECT_EQ(outside(all), 0);
    EXPECT_LT(max_clip_extent(all, s, 1.6).maxCoeff(), 1.0);
    if (outside(table) > 0) {
      EXPECT_GT(all.distance(), table.distance());
    }
  }
  EXPECT_GT(outside(Camera::fit_to_surface(s, CameraPreset::kIso, 1.6)), 0);
  const CameraView posed{CameraPreset::kIso, CameraPose{{0.0, -40.0, 30.0}, {12.0, 12.0, 0.0}}};
  EXPECT_EQ(Camera::from_view(s, posed, 1.6, corners).eye(), Camera::from_view(s, posed, 1.6).eye());
}

TEST(Camera, IsoViewsFromSouthAtFortyDegrees) {
  const Camera camera = Camera::fit_to_surface(make_surface(64, 64), CameraPreset::kIso, 16.0 / 9.0);
  EXPECT_NEAR(camera.elevation() * 180.0 / std::numbers::pi, 40.0, 0.2);
  EXPECT_LT(camera.eye().y(), -0.5);
  EXPECT_NEAR(camera.forward().x(), 0.0, 1e-12);
  EXPECT_NEAR(camera.eye().x(), 31.5, 1.5);  // the middle of 64 columns, shifted slightly by the axes
}

TEST(Camera, TopPresetHasNorthUpAndEastRight) {
  const Camera camera = Camera::fit_to_surface(make_surface(64, 64), CameraPreset::kTop, 1.0);
  const Eigen::Vector3d middle = camera.project({31.5, 31.5, 0.0}, 800, 800);
  EXPECT_NEAR(middle.x(), 400.0, 12.0);
  EXPECT_LT(camera.project({31.5, 60.0, 0.0}, 800, 800).y(), middle.y() - 300.0);
  EXPECT_GT(camera.project({60.0, 31.5, 0.0}, 800, 800).x(), middle.x() + 300.0);
}

TEST(Camera, OrbitKeepsDistanceAndTarget) {
  Camera camera = Camera::fit_to_surface(make_surface(64, 64), CameraPreset::kIso, 1.5);
  const Eigen::Vector3d target = camera.target();
  const double distance = (camera.eye() - target).norm();
  camera.orbit(123.0, -45.0);
  EXPECT_TRUE(camera.target().isApprox(target));
  EXPECT_NEAR((camera.eye() - target).norm(), distance, 1e-9);
  EXPECT_NEAR(camera.forward().norm(), 1.0, 1e-12);
  EXPECT_NEAR(camera.right().dot(camera.forward()), 0.0, 1e-12);
  EXPECT_GT(camera.up().z(), 0.0);
}

TEST(Camera, OrbitRightMovesNearSideRight) {
  Camera camera = Camera::fit_to_surface(make_surface(64, 64), CameraPreset::kIso, 1.0);
  const Eigen::Vector3d near_point = camera.target() - Eigen::Vector3d(0.0, 20.0, 0.0);
  const double before = camera.project(near_point, 800, 800).x();
  camera.orbit(50.0, 0.0);
  EXPECT_GT(camera.project(near_point, 800, 800).x(), before + 20.0);
}

TEST(Camera, ClampsElevation) {
  Camera camera = Camera::fit_to_surface(make_surface(64, 64), CameraPreset::kIso, 1.5);
  camera.orbit(0.0, 1e6);
  EXPECT_DOUBLE_EQ(camera.elevation(), Camera::kMaxElevation);
  camera.orbit(0.0, -1e6);
  EXPECT_DOUBLE_EQ(camera.elevation(), Camera::kMinElevation);
}

TEST(Camera, PanKeepsPointUnderPointer) {
  Camera camera = Camera::fit_to_surface(make_surface(64, 64), CameraPreset::kIso, 1.25);
  const Eigen::Vector3d point = camera.target();
  const Eigen::Vector3d before = camera.project(point, 1000, 800);
  camera.pan(37.0, -21.0, 800);
  const Eigen::Vector3d after = camera.project(point, 1000, 800);
  EXPECT_NEAR(after.x() - before.x(), 37.0, 1e-6);
  EXPECT_NEAR(after.y() - before.y(), -21.0, 1e-6);
}

TEST(Camera, ZoomsByConstantFactorWithinLimits) {
  Camera camera = Camera::fit_to_surface(make_surface(64, 64), CameraPreset::kIso, 1.5);
  const double d0 = camera.distance();
  camera.zoom(1.0);
  const double d1 = camera.distance();
  camera.zoom(1.0);
  EXPECT_LT(d1, d0);
  EXPECT_NEAR(camera.distance() / d1, d1 / d0, 1e-12);
  camera.zoom(-2.0);
  EXPECT_NEAR(camera.distance(), d0, 1e-9);
  camera.zoom(1e4);
  EXPECT_NEAR(camera.distance(), d0 / 200.0, 1e-9);
  camera.zoom(-1e4);
  EXPECT_NEAR(camera.distance(), d0 * 5.0, 1e-9);
}

TEST(CameraPose, TextReadsBackAndPlacesTheCamera) {
  Camera camera = Camera::fit_to_surface(make_surface(64, 64), CameraPreset::kIso, 1.5);
  camera.orbit(210.0, 40.0);
  camera.pan(30.0, -20.0, 600.0);
  camera.zoom(3.0);
  const auto pose = parse_camera_pose(to_string(camera.pose()));
  ASSERT_TRUE(pose);
  Camera other = Camera::fit_to_surface(make_surface(64, 64), CameraPreset::kTop, 1.5);
  other.set_pose(*pose);
  EXPECT_LT((other.eye() - camera.eye()).norm(), 0.02);
  EXPECT_LT((other.target() - camera.target()).norm(), 0.02);
  EXPECT_LT((other.forward() - camera.forward()).norm(), 1e-3);
  const Camera viewed = Camera::from_view(make_surface(64, 64), {CameraPreset::kSide, pose}, 1.5);
  EXPECT_LT((viewed.eye() - camera.eye()).norm(), 0.02);
}

TEST(CameraPose, IsTakenAtAnyDistanceAndElevation) {
  const scene::SurfaceSpec s = make_surface(16, 16);
  Camera camera = Camera::fit_to_surface(s, CameraPreset::kIso, 1.5);
  const double fitted = camera.distance();
  const Eigen::Vector3d middle(7.5, 7.5, 0.0);
  for (const Eigen::Vector3d& offset :
       {Eigen::Vector3d(0.0, 0.0, 40.0 * fitted), Eigen::Vector3d(0.0, -7.0 * fitted, 3.0 * fitted),
        Eigen::Vector3d(30.0, -40.0, 1e-3), Eigen::Vector3d(0.0, -1e-3, 1e-3)}) {
    camera.set_pose({middle + offset, middle});
    EXPECT_LT((camera.eye() - middle - offset).norm(), 1e-9 * offset.norm());
    EXPECT_LT((camera.target() - middle).norm(), 1e-12);
  }
  // A target before the table, to which it is far.
  camera.set_pose({{7.5, -40.0 * fitted, 1.0}, {7.5, 1.0 - 40.0 * fitted, 0.9}});
  max_clip_extent(camera, s, 1.5);
  // The wheel brings it nearer step by step, and no farther.
  camera.set_pose({{7.5, 7.5, 40.0 * fitted}, middle});
  max_clip_extent(camera, s, 1.5);
  camera.zoom(-1.0);
  EXPECT_NEAR(camera.distance(), 40.0 * fitted, 1e-9 * fitted);
  camera.zoom(1.0);
  EXPECT_NEAR(camera.distance(), 0.88 * 40.0 * fitted, 1e-9 * fitted);
}

TEST(CameraPose, TextHasSixDigitsAtAnyPitch) {
  const CameraPose pose{{1.25e-4, -3e-4, 2e-4}, {1e-4, 0.0, 0.0}};
  EXPECT_TRUE(parse_camera_pose(to_string(pose))->position.isApprox(pose.position, 1e-6));
}

TEST(CameraPose, RefusesOtherText) {
  for (const char* text : {"", "iso", "1,2,3", "1,2,3:", "1,2:3,4,5", "1,2,3:4,5", "1,2,3:4,5,6,7",
                           "1,2,x:0,0,0", "1,2,nan:0,0,0", "1,2,3:0,0,3", "1,2,3:0,0,9", " 1,2,3:0,0,0"})
    EXPECT_FALSE(parse_camera_pose(text)) << text;
  EXPECT_TRUE(parse_camera_pose("1,2,3:0,0,0"));
  EXPECT_TRUE(parse_camera_pose("-1.5,2e1,3:0,0,-1"));
}

}  // namespace
}  // namespace smartsurf::view
