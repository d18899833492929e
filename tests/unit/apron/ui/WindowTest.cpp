#include "apron/ui/window/Window.h"

#include <gtest/gtest.h>

#include <cstdlib>

#include "apron/ui/window/OffscreenRenderer.h"
#include "common/error/UserError.h"
#include "tests/unit/apron/ui/UiFixture.h"

namespace apron::ui::test {
namespace {

class WindowTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!Window::display_available()) GTEST_SKIP() << "no display";
  }
};

TEST(WindowWithoutDisplay, ReportsErrorInOneLine) {
  if (Window::display_available()) GTEST_SKIP() << "there is a display";
  try {
    Window window("test", {});
    FAIL() << "no error";
  } catch (const common::UserError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
}

TEST_F(WindowTest, MatchesOffscreenRendering) {
  UiFixture fixture(debugger::test::kCounting);
  fixture.model.step(debugger::StepUnit::kTick);
  fixture.process_commands();
  // In the screen's corner, away from the pointer, which would open a tooltip.
  const WindowPlacement place{640, 480, true, 0, 0, false};
  common::Image shown;
  {
    Window window("test", place);
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(window.render_frame(fixture.model));
    shown = window.capture(fixture.model);
    EXPECT_EQ(window.take_gl_error(), 0U);
  }
  ASSERT_EQ(shown.width, 640);
  OffscreenRenderer screen(640, 480);
  const common::Image wanted = screen.render_settled(fixture.model);
  int different = 0;
  for (std::size_t i = 0; i < shown.rgb.size(); ++i)
    different += std::abs(shown.rgb[i] - wanted.rgb[i]) > 16 ? 1 : 0;
  EXPECT_LT(different, 3000);
}

// A key that goes down and up between two frames is seen by the next frame, once.
TEST_F(WindowTest, ShortTapsAreSeen) {
  UiFixture fixture(debugger::test::kCounting);
  Window window("test", {640, 480, true, 0, 0, false});
  for (int i = 0; i < 4; ++i) ASSERT_TRUE(window.render_frame(fixture.model));
  for (int tap = 1; tap <= 6; ++tap) {
    if (std::system("xdotool mousemove 320 240 key --delay 0 F1 2>/dev/null") != 0)
      GTEST_SKIP() << "no xdotool";
    const bool shown = tap % 2 == 1;
    // Until the display has delivered it.
    for (int i = 0; i < 100 && fixture.model.help_shown != shown; ++i) {
      window.wait_events(0.01);
      ASSERT_TRUE(window.render_frame(fixture.model));
    }
    EXPECT_EQ(fixture.model.help_shown, shown) << "tap " << tap;
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(window.render_frame(fixture.model));
    EXPECT_EQ(fixture.model.help_shown, shown) << "tap " << tap;
  }
}

TEST_F(WindowTest, OpensBesideSimulatorAndCloses) {
  UiFixture fixture(debugger::test::kCounting);
  WindowPlacement beside;
  beside.beside_simulator = true;
  Window window("test", beside);
  EXPECT_TRUE(window.render_frame(fixture.model));
  window.wait_events(0.001);
  window.close();
  EXPECT_FALSE(window.render_frame(fixture.model));
  EXPECT_EQ(window.take_gl_error(), 0U);
}

TEST_F(WindowTest, ReopensAfterClose) {
  UiFixture fixture(debugger::test::kCounting);
  for (int i = 0; i < 3; ++i) {
    Window window("test", {});
    EXPECT_TRUE(window.render_frame(fixture.model));
  }
}

}  // namespace
}  // namespace apron::ui::test
