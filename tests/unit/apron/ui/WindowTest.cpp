#include "apron/ui/Window.h"

#include <gtest/gtest.h>

#include "apron/ui/Offscreen.h"
#include "tests/unit/apron/ui/Desk.h"

namespace apron::ui::test {
namespace {

class WindowTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!Window::display_available()) GTEST_SKIP() << "no display";
  }
};

TEST(WindowWithoutDisplay, SaysSoInOneLine) {
  if (Window::display_available()) GTEST_SKIP() << "there is a display";
  try {
    Window window("test", {});
    FAIL() << "no error";
  } catch (const PictureError& error) {
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
  }
}

TEST_F(WindowTest, ShowsWhatThePicturesShow) {
  Desk desk(debugger::test::kCounting);
  desk.bench.step(debugger::Unit::kTick);
  desk.obey();
  // In the screen's corner, away from the pointer, which would be told what it points at.
  const Placement place{640, 480, true, 0, 0, false};
  Image shown;
  {
    Window window("test", place);
    for (int i = 0; i < 4; ++i) ASSERT_TRUE(window.frame(desk.bench));
    shown = window.picture(desk.bench);
    EXPECT_EQ(window.take_error(), 0U);
  }
  ASSERT_EQ(shown.width, 640);
  Offscreen screen(640, 480);
  const Image wanted = screen.settle(desk.bench);
  int different = 0;
  for (std::size_t i = 0; i < shown.rgb.size(); ++i)
    different += std::abs(shown.rgb[i] - wanted.rgb[i]) > 16 ? 1 : 0;
  EXPECT_LT(different, 3000);
}

TEST_F(WindowTest, IsPlacedBesideAnotherAndClosed) {
  Desk desk(debugger::test::kCounting);
  Placement beside;
  beside.beside = true;
  Window window("test", beside);
  EXPECT_TRUE(window.frame(desk.bench));
  window.wait(0.001);
  window.close();
  EXPECT_FALSE(window.frame(desk.bench));
  EXPECT_EQ(window.take_error(), 0U);
}

TEST_F(WindowTest, IsOpenedAgainAfterItWasClosed) {
  Desk desk(debugger::test::kCounting);
  for (int i = 0; i < 3; ++i) {
    Window window("test", {});
    EXPECT_TRUE(window.frame(desk.bench));
  }
}

}  // namespace
}  // namespace apron::ui::test
