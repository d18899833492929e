#include "smartsurf/view/window/Window.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>

#include "smartsurf/view/model/TableBounds.h"
#include "smartsurf/view/output/OffscreenView.h"
#include "tests/unit/smartsurf/view/TestScene.h"

namespace smartsurf::view {
namespace {

// Shown scenes are paused: those that run are drawn at a resolution that depends on the time that a frame
// takes.
class WindowTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!Window::display_available()) GTEST_SKIP() << "no display";
    setenv("XDG_CONFIG_HOME", testing::TempDir().c_str(), 1);  // the layout of the user is not read
  }
  static int different_pixels(const common::Image& a, const common::Image& b) {
    int count = 0;
    for (std::size_t i = 0; i < a.rgb.size(); i += 3)
      count += std::abs(a.rgb[i] - b.rgb[i]) + std::abs(a.rgb[i + 1] - b.rgb[i + 1]) > 12 ? 1 : 0;
    return count;
  }
  // Centre of the red object, pixels. A selection moves the scene beside its panel.
  static Eigen::Vector2d centre_of_red(const common::Image& image) {
    Eigen::Vector2d sum(0, 0);
    int count = 0;
    for (int y = 0; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x)
        if (const std::uint8_t* p = image.pixel(x, y); p[0] > 100 && p[0] > 2 * std::max(p[1], p[2]))
          sum += Eigen::Vector2d(x, y), ++count;
    return sum / std::max(count, 1);
  }
};

TEST(WindowWithoutDisplay, ThrowsOneLineError) {
  if (Window::display_available()) GTEST_SKIP() << "there is a display";
  try {
    Window window(scene::SceneSpec{}, "test");
    FAIL() << "no error";
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
}

TEST_F(WindowTest, ShowsScenePanelAndHelp) {
  TestScene scene(16, 16);
  scene.add_sphere(7.5, 7.5, 6.0, 2.0, {0.86f, 0.12f, 0.10f});
  Window window(scene.spec, "test", 800, 600);
  Status status;
  status.mode = "time-step";
  status.paused = true;
  const auto shown = [&] {
    common::Image image;
    for (int i = 0; i < 3; ++i) image = window.capture_frame({scene.snapshot, scene.spec.objects}, status);
    return image;  // ImGui needs extra frames to determine the panel's size
  };
  const common::Image image = shown();
  ASSERT_GE(image.width, 800);
  int red = 0;
  for (int y = image.height / 4; y < 3 * image.height / 4; ++y)
    for (int x = image.width / 4; x < 3 * image.width / 4; ++x)
      red += image.pixel(x, y)[0] > 2 * image.pixel(x, y)[1] ? 1 : 0;
  EXPECT_GT(red, 1000) << "no sphere in the middle of the window";
  const common::Image bare =
      window.capture_scene({scene.snapshot, scene.spec.objects}, image.width, image.height);
  EXPECT_GT(different_pixels(image, bare), 5000) << "no panel";
  window.perform(UiAction::kHelp);
  EXPECT_GT(different_pixels(image, shown()), 20000) << "no help";
}

TEST_F(WindowTest, LongMetricNamesLeaveRoomForValues) {
  TestScene scene(8, 8);
  Window window(scene.spec, "test", 800, 600);
  Status status;
  status.paused = true;
  const auto shown = [&](double value) {
    const std::pair<std::string, double> metrics[] = {{std::string(60, 'm'), value}};
    status.metrics = metrics;
    common::Image image;
    for (int i = 0; i < 3; ++i) image = window.capture_frame({scene.snapshot, scene.spec.objects}, status);
    return image;
  };
  EXPECT_GT(different_pixels(shown(1.0), shown(88880.0)), 100) << "the value is cut";
}

// All metrics are in the panel, where many scroll: they take no more room than twelve. Long names that differ
// at their ends stay apart.
TEST_F(WindowTest, ManyMetricsScroll) {
  TestScene scene(8, 8);
  Window window(scene.spec, "test", 800, 800);
  Status status;
  status.paused = true;
  const auto shown = [&](int count, int first) {
    std::vector<std::pair<std::string, double>> metrics;
    for (int i = 0; i < count; ++i)
      metrics.emplace_back(std::string(50, 'm') + std::to_string(1000 + first + i), 1.0);
    status.metrics = metrics;
    common::Image image;
    for (int i = 0; i < 4; ++i) image = window.capture_frame({scene.snapshot, scene.spec.objects}, status);
    return image;
  };
  const common::Image eight = shown(8, 0), twelve = shown(12, 0), many = shown(500, 0);
  EXPECT_GT(different_pixels(eight, twelve), 20) << "the ninth metric is missing";
  EXPECT_GT(different_pixels(twelve, many), 5) << "the scroll bar";
  const auto below = twelve.rgb.begin() + std::ptrdiff_t{3} * twelve.width * 480;
  EXPECT_TRUE(std::equal(below, twelve.rgb.end(), many.rgb.begin() + (below - twelve.rgb.begin())))
      << "moves";
  EXPECT_GT(different_pixels(eight, shown(8, 100)), 20) << "numbers at the end are cut off";
}

TEST_F(WindowTest, ShowsGreekAndCyrillicLetters) {
  TestScene scene(8, 8);
  Window window(scene.spec, "test", 800, 600);
  Status status;
  status.paused = true;
  const auto shown = [&](const char* name) {
    const std::pair<std::string, double> metrics[] = {{name, 1.0}};
    status.metrics = metrics;
    common::Image image;
    for (int i = 0; i < 3; ++i) image = window.capture_frame({scene.snapshot, scene.spec.objects}, status);
    return image;
  };
  EXPECT_GT(different_pixels(shown("\u0416"), shown("\u042F")), 10);
  EXPECT_GT(different_pixels(shown("\u03A9"), shown("\u03A8")), 10);
}

TEST_F(WindowTest, CoexistsWithOffscreenRendering) {
  TestScene scene(8, 8);
  scene.add_sphere(3.5, 3.5, 6.0, 2.0, {0.86f, 0.12f, 0.10f});
  Window window(scene.spec, "test", 400, 300);
  const Camera camera =
      Camera::fit_to_surface(scene.spec.surface, CameraPreset::kIso, 4.0 / 3.0,
                             corners_of_objects_over(scene.spec.surface, scene.snapshot, scene.spec.objects));
  window.perform(UiAction::kPanels);  // the scene has the whole window
  window.render_frame({scene.snapshot, scene.spec.objects}, {});
  const common::Image of_window = window.capture_scene({scene.snapshot, scene.spec.objects}, 400, 300);
  const common::Image alone =
      render_image(scene.spec, scene.snapshot, scene.spec.objects, camera, {}, 400, 300);
  common::Image again = window.capture_scene({scene.snapshot, scene.spec.objects}, 400, 300);
  EXPECT_EQ(of_window.rgb, again.rgb);
  EXPECT_LT(different_pixels(alone, again), 400) << "the window's initial camera differs";
}

TEST_F(WindowTest, ReturnsUserCommands) {
  TestScene scene(4, 4);
  Window window(scene.spec, "test", 320, 240);
  window.perform(UiAction::kPause);
  window.perform(UiAction::kQuit);
  const Commands commands = window.render_frame({scene.snapshot, scene.spec.objects}, {});
  EXPECT_TRUE(commands.toggle_pause);
  EXPECT_TRUE(commands.quit);
  EXPECT_FALSE(window.poll({}).quit);
}

std::size_t memory_kB() {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;)
    if (word == "VmRSS:") {
      std::size_t kilobytes = 0;
      status >> kilobytes;
      return kilobytes;
    }
  return 0;
}

TEST_F(WindowTest, MemoryStaysConstantOverManyFrames) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "AddressSanitizer quarantines freed memory and detects leaks itself";
#endif
  TestScene scene(12, 12);
  for (int i = 0; i < 20; ++i) scene.add_sphere(0.5 * i, 3.0, 6.0, 0.5, {0.2f, 0.6f, 0.9f});
  Window window(scene.spec, "test", 320, 240);
  Status status;
  status.paused = true;
  status.timeline = Timeline{10, 3, 0.0, 1.0, true, {}};
  window.perform(UiAction::kTrails);
  window.perform(UiAction::kWireframe);
  const auto frames = [&](int count) {
    for (int i = 0; i < count; ++i) {
      scene.snapshot.tick += 1;
      scene.snapshot.time_s += 1.0 / 60.0;
      scene.snapshot.position[0][0] = static_cast<float>(i % 8);
      window.render_frame({scene.snapshot, scene.spec.objects}, status);
    }
  };
  // A leak grows in each round, a driver's cache in one.
  std::size_t least_growth = std::numeric_limits<std::size_t>::max();
  frames(100);
  for (int round = 0; round < 3 && least_growth >= 2000; ++round) {
    const std::size_t before = memory_kB();
    frames(100);
    least_growth = std::min(least_growth, std::max(memory_kB(), before) - before);
  }
  EXPECT_LT(least_growth, 2000u) << "leaks more than 20 kB per frame";
}

TEST_F(WindowTest, ClickSelectsAndControlDragPulls) {
  TestScene scene(16, 16);
  scene.add_sphere(7.5, 7.5, 6.0, 3.0, {0.86f, 0.12f, 0.10f});
  Window window(scene.spec, "test", 800, 600);
  Status status;
  status.accepts_interaction = true;
  status.paused = true;
  Eigen::Vector2d at;
  const auto point = [&](PointerEvent::Kind kind, double dx, bool control) {
    window.add_pointer_event({kind, PointerEvent::Button::kLeft, at.x() + dx, at.y(), control, false});
  };
  const auto shown = [&] {
    common::Image image;
    for (int i = 0; i < 3; ++i) image = window.capture_frame({scene.snapshot, scene.spec.objects}, status);
    return image;
  };
  const common::Image plain = shown();
  at = centre_of_red(plain);
  point(PointerEvent::Kind::kPress, 0, false);
  point(PointerEvent::Kind::kRelease, 0, false);
  const common::Image selected = shown();
  EXPECT_GT(different_pixels(plain, selected), 2000) << "no inspector panel";
  at = centre_of_red(selected);
  point(PointerEvent::Kind::kPress, 0, true);
  point(PointerEvent::Kind::kMove, 50, true);
  EXPECT_TRUE(window.render_frame({scene.snapshot, scene.spec.objects}, status).pull);
  point(PointerEvent::Kind::kRelease, 50, true);
  EXPECT_FALSE(window.render_frame({scene.snapshot, scene.spec.objects}, status).pull);
}

TEST_F(WindowTest, ShowsPlotsOfTheStoredHistoryListAndEventMarks) {
  TestScene scene(16, 16);
  scene.add_sphere(7.5, 7.5, 6.0, 2.0, {0.86f, 0.12f, 0.10f});
  StoredFrames history;
  for (int i = 0; i < 200; ++i) {
    scene.snapshot.time_s = 0.1 * i;
    scene.snapshot.position[0][0] = static_cast<float>(i % 16);
    history.frames.push_back(scene.snapshot);
  }
  Window window(scene.spec, "test", 800, 600);
  Status status;
  status.timeline = Timeline{200, 199, 0.0, 19.9, false, {}};
  status.paused = true;
  const FrameInput input{scene.snapshot, scene.spec.objects, {}, {}, &history};
  const auto shown = [&] {
    common::Image image;
    for (int i = 0; i < 4; ++i) image = window.capture_frame(input, status);
    return image;
  };
  // Pixels of the first curve's colour in the lower half.
  const auto curve_pixels = [](const common::Image& image) {
    int count = 0;
    for (int y = image.height / 2; y < image.height; ++y)
      for (int x = 0; x < image.width; ++x) {
        const std::uint8_t* p = image.pixel(x, y);
        count += p[0] < 40 && std::abs(p[1] - 115) < 25 && std::abs(p[2] - 179) < 25 ? 1 : 0;
      }
    return count;
  };
  const common::Image plain = shown();
  EXPECT_LT(curve_pixels(plain), 20);
  ViewSettings settings;
  settings.plots = {*parse_signal("x:0")};
  window.apply(settings);
  EXPECT_GT(curve_pixels(shown()), 1000) << "no curve";
  history.metric_start = 1e17;  // up to 1e17 + 16, the next number: a constant up to rounding
  history.metric_step = 16.0 / 200.0;
  settings.plots = {*parse_signal("frame")};
  window.apply(settings);
  EXPECT_GT(curve_pixels(shown()), 200) << "no constant";
  window.apply({});
  const common::Image before_list = shown();
  window.perform(UiAction::kEntities);
  EXPECT_GT(different_pixels(before_list, shown()), 5000) << "no list";
  window.perform(UiAction::kEntities);
  const EventMark marks[] = {{EventMark::Kind::kSuccess, 10.0, "success"}};
  status.timeline->marks = marks;
  const common::Image marked = shown();
  int green = 0;
  for (int y = marked.height / 2; y < marked.height; ++y)
    for (int x = 0; x < marked.width; ++x) {
      const std::uint8_t* p = marked.pixel(x, y);
      green += p[0] < 40 && std::abs(p[1] - 125) < 15 && p[2] < 80 ? 1 : 0;
    }
  EXPECT_GT(green, 25) << "no event mark";
}

TEST_F(WindowTest, NeedsRedrawAfterInput) {
  TestScene scene(4, 4);
  Window window(scene.spec, "test", 320, 240);
  const auto draw = [&] { window.render_frame({scene.snapshot, scene.spec.objects}, {}); };
  // The window system sends events after the window opens, as late as it likes: quiet are ten frames without
  // any.
  const auto becomes_quiet = [&] {
    for (int i = 0, quiet = 0; i < 1000; ++i) {
      draw();
      quiet = window.needs_redraw() ? 0 : quiet + 1;
      if (quiet == 10) return true;
    }
    return false;
  };
  ASSERT_TRUE(becomes_quiet());
  window.perform(UiAction::kGrid);
  EXPECT_TRUE(window.needs_redraw());
  ASSERT_TRUE(becomes_quiet());
  window.add_pointer_event({PointerEvent::Kind::kMove, PointerEvent::Button::kLeft, 10, 10, false, false});
  EXPECT_TRUE(window.needs_redraw());
}

TEST_F(WindowTest, SetSceneSwitchesSurface) {
  TestScene small(8, 8), large(24, 12);
  large.add_sphere(5.0, 5.0, 6.0, 2.0, {0.86f, 0.12f, 0.10f});
  Window window(small.spec, "test", 400, 300);
  window.render_frame({small.snapshot, small.spec.objects}, {});
  window.set_scene(large.spec, "large");
  const common::Image image = window.capture_frame({large.snapshot, large.spec.objects}, {});
  EXPECT_EQ(image.width, 400);
}

}  // namespace
}  // namespace smartsurf::view
