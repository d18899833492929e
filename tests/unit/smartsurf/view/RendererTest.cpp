#include "smartsurf/view/gl/Renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>

#include "common/gl/EglContext.h"
#include "smartsurf/view/gl/GlObjects.h"
#include "tests/unit/smartsurf/view/DrawCallCounter.h"
#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

// Rows of objects of all primitive shapes above pins of different heights.
TestScene make_crowd(int cells, int objects) {
  TestScene scene(cells, cells);
  for (int row = 0; row < cells; ++row)
    for (int column = 0; column < cells; ++column)
      scene.snapshot.height[scene.spec.surface.index(row, column)] =
          2.0f + std::sin(0.7f * static_cast<float>(column)) + (row / 6 % 2 == 0 ? 0.0f : 1.5f);
  const int across = std::max(1, (cells - 2) / 3);
  for (int k = 0; k < objects; ++k) {
    scene::ObjectSpec o;
    o.shape = static_cast<scene::ShapeKind>(k % 5);
    o.radius = 1.0;
    o.height = 2.0;
    o.size = {1.5, 1.5, 1.5};
    o.colour = {0.8f, 0.3f, 0.1f};
    o.position = {2.0 + 3.0 * (k % across), 2.0 + 3.0 * (k / across % across), 4.5};
    scene.add(o);
  }
  return scene;
}

class RendererTest : public testing::Test {
 protected:
  static constexpr int kWidth = 480, kHeight = 300;
  static void SetUpTestSuite() {
    unsetenv("DISPLAY");
    unsetenv("WAYLAND_DISPLAY");
  }
  void SetUp() override { target_.resize(kWidth, kHeight); }
  void draw(Renderer& renderer, const TestScene& scene) {
    renderer.draw(
        scene.snapshot, scene.spec.objects,
        Camera::fit_to_surface(scene.spec.surface, CameraPreset::kIso, static_cast<double>(kWidth) / kHeight),
        {}, target_.framebuffer.id(), kWidth, kHeight);
  }
  common::Image render(const TestScene& scene, const RenderQuality& quality) {
    Renderer renderer(scene.spec, quality);
    draw(renderer, scene);
    return read_framebuffer(target_.framebuffer.id(), kWidth, kHeight);
  }
  int count_draw_calls(const TestScene& scene) {
    Renderer renderer(scene.spec, {1, 256, RenderPass::kColour});
    draw(renderer, scene);
    const DrawCallCounter calls;
    draw(renderer, scene);
    return calls.count();
  }

  common::EglContext context_;
  RenderTarget target_;
};

TEST_F(RendererTest, DrawCallsDoNotDependOnObjectCount) {
  const int few = count_draw_calls(make_crowd(8, 5)), many = count_draw_calls(make_crowd(96, 900));
  EXPECT_EQ(many, few);
  // Pins and five shapes, each in the shadow and the colour pass; ground and backdrop.
  EXPECT_EQ(few, 2 * 6 + 2);
}

// Seen along the gaps between the columns, the wall at the back shows no background through its own gaps.
TEST_F(RendererTest, BackWallHasNoSlits) {
  TestScene scene(24, 24);
  scene.spec.surface.border_height = 6.0;
  for (int row = 0; row < 24; ++row)
    for (int column = 0; column < 24; ++column)
      scene.snapshot.height[scene.spec.surface.index(row, column)] =
          scene.spec.surface.is_border(row, column) ? 6.0f : 4.0f;
  const Camera camera =
      Camera::fit_to_surface(scene.spec.surface, CameraPreset::kIso, static_cast<double>(kWidth) / kHeight);
  for (const RenderQuality& quality : {RenderQuality::fine(), RenderQuality::video()}) {
    const common::Image image = render(scene, quality);
    for (double x = 1.5; x < 21.5; x += 0.05) {
      const Eigen::Vector3d at = camera.project({x, 22.6, 5.3}, kWidth, kHeight);
      const std::size_t pixel =
          3 * (static_cast<std::size_t>(at.y()) * kWidth + static_cast<std::size_t>(at.x()));
      EXPECT_LT(image.rgb[pixel], 150) << "x = " << x;
    }
  }
}

// Between narrow tops one sees through the table's edge, as in a free layout with the same places.
TEST_F(RendererTest, WideGapsStayOpen) {
  std::mt19937 random(20261129);
  std::uniform_real_distribution<double> share(0.27, 0.9);
  for (const RenderQuality& quality :
       {RenderQuality::fine(), RenderQuality::video(), RenderQuality::fast(), RenderQuality::gpu()})
    for (const int cells : {4, 48}) {  // near, and so far that narrow gaps are painted
      TestScene scene(cells, cells);
      scene::SurfaceSpec& s = scene.spec.surface;
      s.pin.top_x = s.pitch * (1.0 - share(random));
      s.pin.top_y = s.pitch * (1.0 - share(random));
      const common::Image grid = render(scene, quality);
      std::vector<scene::CellPose> poses;
      for (int row = 0; row < cells; ++row)
        for (int column = 0; column < cells; ++column)
          poses.push_back({s.centre(row, column).x(), s.centre(row, column).y(), 0.0});
      s.cell_poses = poses;
      EXPECT_EQ(grid.rgb, render(scene, quality).rgb) << s.pin.top_x << " x " << s.pin.top_y;
    }
}

// Ambient occlusion only darkens, and nothing where no object or cell is near.
TEST_F(RendererTest, OcclusionDarkensOnlyWhatIsNear) {
  const TestScene scene = make_crowd(24, 40);
  RenderQuality quality = RenderQuality::video();
  const common::Image with = render(scene, quality);
  quality.occlusion = false;
  const common::Image without = render(scene, quality);
  double sum = 0.0;
  for (std::size_t i = 0; i < with.rgb.size(); ++i) {
    ASSERT_LE(with.rgb[i], without.rgb[i] + 1);
    sum += without.rgb[i] - with.rgb[i];
  }
  EXPECT_GT(sum / static_cast<double>(with.rgb.size()), 2.0);
  for (std::size_t i = 0; i < std::size_t{3} * kWidth; ++i)  // the background, at the picture's edge
    EXPECT_NEAR(with.rgb[i], without.rgb[i], 2);
}

// At the bottom of a conical pit whose walls rise at 30° three quarters of the sky are visible, however small
// it is.
TEST_F(RendererTest, OcclusionInAShallowPitIsMild) {
  constexpr int kNodes = 61;
  constexpr double kSlope = 0.57735;
  for (const double radius : {0.6, 1.5, 3.0}) {
    TestScene scene(16, 16);
    scene.spec.surface.skin.emplace().rows = kNodes;
    scene.spec.surface.skin->columns = kNodes;
    const Eigen::AlignedBox2d extent = scene.spec.surface.skin_extent();
    const Eigen::Vector2d middle = extent.center();
    for (int row = 0; row < kNodes; ++row)
      for (int column = 0; column < kNodes; ++column) {
        const Eigen::Vector2d at =
            extent.min() +
            Eigen::Vector2d(column, kNodes - 1 - row).cwiseProduct(extent.sizes() / (kNodes - 1));
        const double below = std::max(radius - (at - middle).norm(), 0.0) * kSlope;
        scene.snapshot.skin_height.push_back(static_cast<float>(4.0 - below));
      }
    RenderQuality quality = RenderQuality::video();
    const common::Image with = render(scene, quality);
    quality.occlusion = false;
    const common::Image without = render(scene, quality);
    for (std::size_t i = 0; i < with.rgb.size(); ++i)
      if (without.rgb[i] > 100) {
        ASSERT_GE(with.rgb[i], 0.6 * without.rgb[i]) << "pit of radius " << radius;
      }
  }
}

TEST_F(RendererTest, FastQualityResemblesFullQuality) {
  const TestScene scene = make_crowd(24, 40);
  const common::Image cheap = render(scene, RenderQuality::fast()),
                      full = render(scene, {1, 2048, RenderPass::kColour});
  double sum = 0.0;
  int far = 0;
  for (std::size_t i = 0; i < full.rgb.size(); ++i) {
    const int difference = std::abs(cheap.rgb[i] - full.rgb[i]);
    sum += difference;
    far += difference > 60 ? 1 : 0;
  }
  const double values = static_cast<double>(full.rgb.size());
  EXPECT_LT(sum / values, 16.0) << "mean difference, of 255";
  EXPECT_LT(far / values, 0.03) << "expected only at edges of shadows and sphere bands";
  EXPECT_NE(cheap.rgb, full.rgb);
}

}  // namespace
}  // namespace smartsurf::view
