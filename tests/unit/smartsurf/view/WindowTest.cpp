#include "smartsurf/view/Window.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <stdexcept>

#include "tests/unit/smartsurf/view/Scenes.h"

namespace smartsurf::view {
namespace {

class WindowTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!Window::display_available()) GTEST_SKIP() << "no display";
  }
  static int different_pixels(const Image& a, const Image& b) {
    int count = 0;
    for (std::size_t i = 0; i < a.rgb.size(); i += 3)
      count += std::abs(a.rgb[i] - b.rgb[i]) + std::abs(a.rgb[i + 1] - b.rgb[i + 1]) > 12 ? 1 : 0;
    return count;
  }
};

TEST(WindowWithoutDisplay, SaysSoInOneLine) {
  if (Window::display_available()) GTEST_SKIP() << "there is a display";
  try {
    Window window(scene::SceneSpec{}, "test");
    FAIL() << "no error";
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
}

TEST_F(WindowTest, ShowsTheSceneAndItsPanelAndHelp) {
  Scene scene(16, 16);
  scene.add_sphere(7.5, 7.5, 6.0, 2.0, {0.86f, 0.12f, 0.10f});
  Window window(scene.spec, "test", 800, 600);
  Status status;
  status.mode = "time-step";
  for (int i = 0; i < 3; ++i) window.frame(scene.snapshot, scene.spec.objects, status);
  const Image image = window.contents();
  ASSERT_GE(image.width, 800);
  const std::uint8_t* middle = image.pixel(image.width / 2, image.height / 2);
  EXPECT_GT(middle[0], 2 * middle[1]) << "the sphere is not in the middle of the window";
  const Image bare = window.picture(scene.snapshot, scene.spec.objects, image.width, image.height);
  EXPECT_GT(different_pixels(image, bare), 5000) << "no panel";
  window.press(Key::kHelp);
  for (int i = 0; i < 3; ++i) window.frame(scene.snapshot, scene.spec.objects, status);
  EXPECT_GT(different_pixels(image, window.contents()), 20000) << "no help";
}

TEST_F(WindowTest, HandsTheUsersWishesToTheCaller) {
  Scene scene(4, 4);
  Window window(scene.spec, "test", 320, 240);
  window.press(Key::kPause);
  window.press(Key::kQuit);
  const Commands commands = window.frame(scene.snapshot, {}, {});
  EXPECT_TRUE(commands.toggle_pause);
  EXPECT_TRUE(commands.quit);
  EXPECT_FALSE(window.poll({}).quit);
}

}  // namespace
}  // namespace smartsurf::view
