#include "smartsurf/view/output/OffscreenView.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <vector>

#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

constexpr int kWidth = 320, kHeight = 240;
const scene::Colour kRed{0.86f, 0.12f, 0.10f};

class OffscreenViewTest : public testing::Test {
 protected:
  // No display server, as on a compute node.
  static void SetUpTestSuite() {
    unsetenv("DISPLAY");
    unsetenv("WAYLAND_DISPLAY");
  }
  static Camera camera(const TestScene& scene, CameraPreset preset = CameraPreset::kIso) {
    return Camera::fit_to_surface(scene.spec.surface, preset, static_cast<double>(kWidth) / kHeight);
  }
  static common::Image draw(const TestScene& scene, CameraPreset preset = CameraPreset::kIso,
                            const DrawOptions& options = {}) {
    return render_image(scene.spec, scene.snapshot, scene.spec.objects, camera(scene, preset), options,
                        kWidth, kHeight);
  }
  // The pixel at the projection of a world point.
  static const std::uint8_t* at(const common::Image& image, const TestScene& scene,
                                const Eigen::Vector3d& point, CameraPreset preset = CameraPreset::kIso) {
    const Eigen::Vector3d p = camera(scene, preset).project(point, kWidth, kHeight);
    return image.pixel(static_cast<int>(p.x()), static_cast<int>(p.y()));
  }
  static bool is_red(const std::uint8_t* p) { return p[0] > 110 && p[0] > 2 * p[1] && p[0] > 2 * p[2]; }
  static bool is_grey(const std::uint8_t* p) {
    return std::abs(p[0] - p[1]) < 25 && std::abs(p[1] - p[2]) < 40;
  }
  static int sum(const std::uint8_t* p) { return p[0] + p[1] + p[2]; }
};

TEST_F(OffscreenViewTest, RendersSphereTableAndBackground) {
  TestScene scene(16, 16);
  scene.add_sphere(7.5, 7.5, 6.0, 2.0, kRed);
  const common::Image image = draw(scene);
  ASSERT_EQ(image.rgb.size(), static_cast<std::size_t>(kWidth * kHeight * 3));
  EXPECT_TRUE(is_red(at(image, scene, {7.5, 7.5, 7.0})));
  EXPECT_TRUE(is_grey(at(image, scene, {2.0, 3.0, 4.0})));
  EXPECT_TRUE(is_grey(image.pixel(3, 3)));
  EXPECT_GT(sum(image.pixel(3, 3)), 3 * 200);
}

TEST_F(OffscreenViewTest, UnitOfLengthChangesNothing) {
  const auto scaled = [](float unit) {
    TestScene scene(16, 16, 4.0f * unit);
    scene::SurfaceSpec& s = scene.spec.surface;
    s.pitch *= unit;
    for (double* length : {&s.pin.top_x, &s.pin.top_y, &s.pin.length, &s.pin.min_height, &s.pin.max_height})
      *length *= unit;
    scene.add_sphere(7.5 * unit, 7.5 * unit, 6.0 * unit, 2.0 * unit, kRed);
    return draw(scene);
  };
  const common::Image one = scaled(1.0f);
  for (const float unit : {1.0f / 128.0f, 1024.0f}) {
    const common::Image other = scaled(unit);
    int different = 0;
    for (std::size_t i = 0; i < one.rgb.size(); ++i)
      different += std::abs(one.rgb[i] - other.rgb[i]) > 8 ? 1 : 0;
    EXPECT_LT(different, kWidth * kHeight / 100) << unit;
  }
}

TEST_F(OffscreenViewTest, RaisedPinsHideSphereBehindThem) {
  TestScene scene(16, 16, 0.0f);
  scene.add_sphere(8.0, 8.0, 1.0, 1.0, kRed);
  const Eigen::Vector3d top_of_sphere(8.0, 8.0, 1.9);
  EXPECT_TRUE(is_red(at(draw(scene), scene, top_of_sphere)));
  for (int column = 6; column <= 10; ++column)
    scene.snapshot.height[scene.spec.surface.index(9, column)] = 6.0f;
  EXPECT_FALSE(is_red(at(draw(scene), scene, top_of_sphere)));  // row 9 is just south of the sphere
}

TEST_F(OffscreenViewTest, PinsHideSubmergedPartOfSphere) {
  TestScene scene(16, 16);
  scene.add_sphere(8.0, 8.0, 4.0, 2.0, kRed);  // its lower half is below the pins' tops
  const common::Image image = draw(scene);
  EXPECT_TRUE(is_red(at(image, scene, {8.0, 7.6, 5.0})));
  EXPECT_FALSE(is_red(at(image, scene, {8.0, 6.0, 3.0})));
}

TEST_F(OffscreenViewTest, TopViewHasRowZeroAtTopAndColumnZeroAtLeft) {
  TestScene scene(16, 16, 0.0f);
  const auto& surface = scene.spec.surface;
  std::vector<float> values(surface.cell_count(), 0.0f);
  values[surface.index(1, 2)] = 1.0f;  // near the north-west corner
  DrawOptions options;
  options.cell_values = values;
  const common::Image image = draw(scene, CameraPreset::kTop, options);
  const Eigen::Vector2d centre = surface.centre(1, 2);
  const std::uint8_t* p = at(image, scene, {centre.x(), centre.y(), 0.0}, CameraPreset::kTop);
  EXPECT_GT(p[0], 150);  // the palette's yellow
  EXPECT_LT(p[2], 100);
  const Eigen::Vector3d where =
      camera(scene, CameraPreset::kTop).project({centre.x(), centre.y(), 0.0}, kWidth, kHeight);
  EXPECT_LT(where.x(), kWidth / 2);
  EXPECT_LT(where.y(), kHeight / 2);
}

TEST_F(OffscreenViewTest, PinIsAtItsPositionFromEveryAzimuth) {
  TestScene scene(16, 16, 0.0f);
  const auto& surface = scene.spec.surface;
  std::vector<float> values(surface.cell_count(), 0.0f);
  values[surface.index(3, 5)] = 1.0f;
  DrawOptions options;
  options.cell_values = values;
  const Eigen::Vector2d centre = surface.centre(3, 5);
  OffscreenView view(scene.spec);
  for (int quarter = 0; quarter < 4; ++quarter) {
    Camera turned = camera(scene);
    turned.orbit(quarter * EIGEN_PI / 2.0 / 0.006 + 30.0, 0.0);
    const common::Image image = view.render(scene.snapshot, {}, turned, options, kWidth, kHeight);
    const Eigen::Vector3d p = turned.project({centre.x(), centre.y(), 0.0}, kWidth, kHeight);
    const std::uint8_t* pixel = image.pixel(static_cast<int>(p.x()), static_cast<int>(p.y()));
    EXPECT_GT(pixel[0], 120) << "azimuth " << turned.azimuth();
    EXPECT_LT(pixel[2], 100) << "azimuth " << turned.azimuth();
  }
}

TEST_F(OffscreenViewTest, CastsShadowAwayFromLight) {
  TestScene scene(32, 32, 0.0f);
  const common::Image bare = draw(scene, CameraPreset::kTop);
  scene.add_sphere(15.0, 15.0, 8.0, 2.0, kRed);
  const common::Image image = draw(scene, CameraPreset::kTop);
  // The light comes from the south-west: on the pins (z = 0) the shadow is offset by 8/0.80 · (0.52, 0.30).
  const Eigen::Vector3d shaded(20.0, 18.0, 0.0), lit(10.0, 12.0, 0.0);  // both on a pin, not in a gap
  const auto darkening = [&](const Eigen::Vector3d& point) {
    return sum(at(bare, scene, point, CameraPreset::kTop)) - sum(at(image, scene, point, CameraPreset::kTop));
  };
  EXPECT_GT(darkening(shaded), 60);
  EXPECT_LT(darkening(lit), 10);
}

TEST_F(OffscreenViewTest, DrawsBoxesAndCylindersAtTheirPoses) {
  TestScene scene(32, 32, 0.0f);
  scene::ObjectSpec box;
  box.shape = scene::ShapeKind::kBox;
  box.size = {8.0, 1.0, 1.0};
  box.position = {16.0, 16.0, 2.0};
  box.orientation = Eigen::AngleAxisd(EIGEN_PI / 2.0, Eigen::Vector3d::UnitZ());  // now along y
  box.colour = kRed;
  scene.add(box);
  scene::ObjectSpec cylinder;
  cylinder.shape = scene::ShapeKind::kCylinder;
  cylinder.radius = 0.6;
  cylinder.height = 8.0;
  cylinder.position = {6.0, 6.0, 2.0};
  cylinder.orientation = Eigen::AngleAxisd(EIGEN_PI / 2.0, Eigen::Vector3d::UnitY());  // now along x
  cylinder.colour = kRed;
  scene.add(cylinder);
  const common::Image image = draw(scene, CameraPreset::kTop);
  const auto red = [&](double x, double y) {
    return is_red(at(image, scene, {x, y, 2.3}, CameraPreset::kTop));
  };
  EXPECT_TRUE(red(16.0, 13.0));
  EXPECT_TRUE(red(16.0, 19.0));
  EXPECT_FALSE(red(19.0, 16.0));
  EXPECT_TRUE(red(3.0, 6.0));
  EXPECT_TRUE(red(9.0, 6.0));
  EXPECT_FALSE(red(6.0, 9.0));
}

// Points inside and outside a shape's silhouette in the side view, relative to its position.
struct Silhouette {
  scene::ShapeKind shape;
  std::vector<Eigen::Vector3d> inside, outside;
};

TEST_F(OffscreenViewTest, DrawsCapsulesConesAndSolids) {
  auto wedge = std::make_shared<scene::Solid>();  // its top rises to the east
  wedge->vertices = {{-2, -1, -1}, {2, -1, -1}, {2, 1, -1}, {-2, 1, -1}, {2, -1, 2}, {2, 1, 2}};
  wedge->triangles = {{0, 2, 1}, {0, 3, 2}, {0, 1, 4}, {3, 5, 2}, {1, 2, 5}, {1, 5, 4}, {0, 4, 5}, {0, 5, 3}};
  wedge->bounds_min = {-2, -1, -1};
  wedge->bounds_max = {2, 1, 2};
  const Silhouette kinds[] = {
      {scene::ShapeKind::kCapsule, {{0, -1, 1.5}, {0, -1, 0}, {0, 0, 2.8}}, {{0.9, 0, 2.8}, {1.2, 0, 0}}},
      {scene::ShapeKind::kCone, {{0, 0, 4.2}, {0.7, -0.5, -1}}, {{0.7, 0, 3.0}, {-0.7, 0, 3.0}}},
      {scene::ShapeKind::kSolid, {{1.6, -1, 1.0}, {-1, -1, -0.7}}, {{-1, -1, 1.0}, {-1.5, -1, 0.5}}}};
  for (const Silhouette& kind : kinds) {
    SCOPED_TRACE(static_cast<int>(kind.shape));
    TestScene scene(16, 16, 0.0f);
    scene::ObjectSpec object;
    object.shape = kind.shape;
    object.radius = 1.0;
    object.height = 6.0;
    object.solid = wedge;
    object.position = {7.5, 7.5, 3.5};
    object.colour = kRed;
    scene.add(object);
    const common::Image image = draw(scene, CameraPreset::kSide);
    for (const Eigen::Vector3d& point : kind.inside)
      EXPECT_TRUE(is_red(at(image, scene, object.position + point, CameraPreset::kSide)))
          << point.transpose();
    for (const Eigen::Vector3d& point : kind.outside)
      EXPECT_FALSE(is_red(at(image, scene, object.position + point, CameraPreset::kSide)))
          << point.transpose();
    DrawOptions wires;
    wires.fill_mode = FillMode::kWireframe;
    EXPECT_NE(draw(scene, CameraPreset::kSide, wires).rgb, image.rgb);
  }
}

TEST_F(OffscreenViewTest, DrawsLines) {
  TestScene scene(16, 16);
  const Line lines[] = {{{2, 2, 6}, {13, 13, 6}, {220, 20, 20, 255}}};
  DrawOptions options;
  options.lines = lines;
  options.line_width = 4.0f;
  const common::Image image = draw(scene, CameraPreset::kTop, options);
  for (const double t : {3.0, 7.0, 12.0})
    EXPECT_TRUE(is_red(at(image, scene, {t, t, 6.0}, CameraPreset::kTop))) << t;
  EXPECT_FALSE(is_red(at(image, scene, {1.0, 1.0, 6.0}, CameraPreset::kTop)));
  EXPECT_FALSE(is_red(at(image, scene, {7.0, 9.0, 6.0}, CameraPreset::kTop)));
}

TEST_F(OffscreenViewTest, DrawsLegendInLowerRightCorner) {
  TestScene scene(16, 16);
  const std::vector<float> values(256, 0.5f);
  const ColourScale colour_scale{"proximity", "u", Palette::kSpectrum, 0.0f, 8.0f};
  DrawOptions plain, with_legend;
  plain.cell_values = with_legend.cell_values = values;
  with_legend.legend = &colour_scale;
  OffscreenView view(scene.spec);
  const auto draw_big = [&](const DrawOptions& options) {
    return view.render(scene.snapshot, scene.spec.objects, camera(scene), options, 640, 480);
  };
  const common::Image bare = draw_big(plain), image = draw_big(with_legend);
  int changed_corner = 0, changed_elsewhere = 0, blue = 0, red = 0;
  for (int y = 0; y < 480; ++y)
    for (int x = 0; x < 640; ++x) {
      const std::uint8_t *a = bare.pixel(x, y), *b = image.pixel(x, y);
      const bool changed = std::abs(a[0] - b[0]) + std::abs(a[1] - b[1]) + std::abs(a[2] - b[2]) > 6;
      const bool corner = x > 400 && y > 400;
      changed_corner += changed && corner;
      changed_elsewhere += changed && !corner;
      blue += corner && b[2] > 150 && b[0] < 60;
      red += corner && b[0] > 150 && b[2] < 60;
    }
  EXPECT_GT(changed_corner, 3000);
  EXPECT_EQ(changed_elsewhere, 0);
  EXPECT_GT(blue, 30) << "the dark end";
  EXPECT_GT(red, 30) << "the bright end";
  EXPECT_EQ(draw_big(plain).rgb, bare.rgb) << "the legend remained";
}

TEST_F(OffscreenViewTest, WireframeLeavesCellsVisible) {
  TestScene scene(16, 16, 0.0f);
  scene.add_sphere(7.5, 7.5, 3.0, 3.0, kRed);
  std::vector<float> values(256, 0.5f);
  DrawOptions options;
  options.fill_mode = FillMode::kWireframe;
  options.cell_values = values;
  const auto red_pixels = [&](const common::Image& image) {
    int count = 0;
    for (int y = 0; y < kHeight; ++y)
      for (int x = 0; x < kWidth; ++x) count += is_red(image.pixel(x, y)) ? 1 : 0;
    return count;
  };
  const int wires = red_pixels(draw(scene, CameraPreset::kTop, options)),
            solid = red_pixels(draw(scene, CameraPreset::kTop));
  EXPECT_GT(wires, 20);
  EXPECT_LT(wires, solid / 2);
}

TEST_F(OffscreenViewTest, RenderingIsReproducible) {
  TestScene scene(16, 16);
  scene.add_sphere(7.5, 7.5, 6.0, 2.0, kRed);
  OffscreenView view(scene.spec);
  const auto again = [&] {
    return view.render(scene.snapshot, scene.spec.objects, camera(scene), {}, kWidth, kHeight).rgb;
  };
  const auto first = again();
  EXPECT_EQ(first, again());
  EXPECT_EQ(first, draw(scene).rgb) << "another context of the same driver";
}

TEST_F(OffscreenViewTest, SkipsRemovedObjectsAndKeepsColoursById) {
  TestScene scene(16, 16);
  scene.add_sphere(4.0, 7.5, 6.0, 2.0, {0.1f, 0.1f, 0.9f});
  scene.add_sphere(11.0, 7.5, 6.0, 2.0, kRed);
  for (auto* array : {&scene.snapshot.position, &scene.snapshot.velocity, &scene.snapshot.angular_velocity})
    array->erase(array->begin());
  scene.snapshot.orientation.erase(scene.snapshot.orientation.begin());
  scene.snapshot.id.erase(scene.snapshot.id.begin());
  const common::Image image = draw(scene);
  EXPECT_TRUE(is_red(at(image, scene, {11.0, 7.5, 7.0})));
  EXPECT_TRUE(is_grey(at(image, scene, {4.0, 7.5, 5.0})));
}

TEST_F(OffscreenViewTest, RejectsInvalidSize) {
  TestScene scene(4, 4);
  OffscreenView view(scene.spec);
  EXPECT_THROW(view.render(scene.snapshot, {}, camera(scene), {}, 0, 100), scene::InputError);
  EXPECT_THROW(view.render(scene.snapshot, {}, camera(scene), {}, 100, 100000), scene::InputError);
}

}  // namespace
}  // namespace smartsurf::view
