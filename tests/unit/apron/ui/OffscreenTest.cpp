// The window drawn without a display: what is where, and what the mouse does.
#include "apron/ui/Offscreen.h"

#include <gtest/gtest.h>
#include <png.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "apron/ui/Film.h"
#include "tests/unit/apron/ui/Desk.h"

namespace apron::ui::test {
namespace {

constexpr int kWidth = 1280, kHeight = 800;

bool is_near(const std::uint8_t* pixel, int red, int green, int blue) {
  return std::abs(pixel[0] - red) < 12 && std::abs(pixel[1] - green) < 12 && std::abs(pixel[2] - blue) < 12;
}

struct Box {
  int left = kWidth, top = kHeight, right = -1, bottom = -1;
  int pixels = 0;
};
// Around all pixels of that colour.
Box find(const Image& image, int red, int green, int blue, int from_x = 0, int to_y = kHeight) {
  Box box;
  for (int y = 0; y < to_y; ++y)
    for (int x = from_x; x < image.width; ++x) {
      if (!is_near(image.pixel(x, y), red, green, blue)) continue;
      box.left = std::min(box.left, x);
      box.right = std::max(box.right, x);
      box.top = std::min(box.top, y);
      box.bottom = std::max(box.bottom, y);
      ++box.pixels;
    }
  return box;
}

// Blue cells but for one red one in the north-west, in the field's middle.
constexpr const char* kCorner = R"(!register(A, B)
reg.setPalette(A, 'spectrum')
reg.setScale(A, 0, 1)
pixel.set(A, 0, 0, 1)
surface.step
)";
constexpr int kListEnd = 302;       // x where the list of registers ends
constexpr int kHistogramTop = 440;  // y, or above it

long resident_pages() {
  long all = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> all >> resident;
  return resident;
}

class OffscreenTest : public testing::Test {
 protected:
  static void click(Offscreen& screen, Desk& desk, float x, float y) {
    screen.point(x, y);
    screen.draw(desk.bench);
    screen.point(x, y, true);
    screen.draw(desk.bench);
    screen.point(x, y, false);
    screen.draw(desk.bench);
    desk.obey();
  }
};

// Two tiles side by side; a click on the right one makes it the large one.
TEST_F(OffscreenTest, TilesStandSideBySide) {
  Desk desk(
      "!register(A, B)\nreg.setPalette(A, 'spectrum')\nreg.setScale(A, 0, 1)\nreg.setPalette(B, 'spectrum')\n"
      "reg.setScale(B, -1, 0)\nsim.display(A, 'low')\nsim.display(B, 'high')\nsim.tile\nsurface.step\n");
  desk.bench.step(debugger::Unit::kTick);
  desk.obey();
  desk.obey();
  Offscreen screen(kWidth, kHeight);
  const Image image = screen.settle(desk.bench);
  const Box blue = find(image, 0, 0, 255, kListEnd), red = find(image, 255, 0, 0, kListEnd);
  EXPECT_GT(blue.pixels, 20000);
  EXPECT_EQ(red.pixels, blue.pixels);
  EXPECT_GT(red.left, blue.right);
  EXPECT_EQ(red.top, blue.top);
  click(screen, desk, static_cast<float>(red.left + red.right) / 2.0F,
        static_cast<float>(red.top + red.bottom) / 2.0F);
  EXPECT_FALSE(desk.bench.tiled());
  EXPECT_EQ(desk.bench.selected(), std::size_t{1});
  EXPECT_EQ(screen.take_error(), 0U);
}

TEST_F(OffscreenTest, ShowsRowZeroInTheNorthAndColumnZeroInTheWest) {
  Desk desk(kCorner);
  desk.bench.step(debugger::Unit::kTick);
  desk.obey();
  Offscreen screen(kWidth, kHeight);
  const Image image = screen.settle(desk.bench);
  const Box blue = find(image, 0, 0, 255, kListEnd, kHistogramTop),
            red = find(image, 255, 0, 0, kListEnd, kHistogramTop);
  ASSERT_GT(blue.pixels, 20000);
  // The legend has these colours too, but it is further to the east.
  EXPECT_NEAR(red.left, blue.left, 3);
  EXPECT_LT(red.top, blue.top + 3);
  const int edge = (blue.right - blue.left) / 8;
  EXPECT_TRUE(is_near(image.pixel(red.left + edge / 2, red.top + edge / 2), 255, 0, 0));
  EXPECT_TRUE(is_near(image.pixel(red.left + edge / 2, red.top + edge + edge / 2), 0, 0, 255));
  EXPECT_TRUE(is_near(image.pixel(red.left + edge + edge / 2, red.top + edge / 2), 0, 0, 255));
  EXPECT_EQ(screen.take_error(), 0U);
}

TEST_F(OffscreenTest, TheSamePictureHasTheSameBytes) {
  std::vector<std::uint8_t> first;
  for (int i = 0; i < 2; ++i) {
    Desk desk(debugger::test::kCounting);
    desk.bench.run();
    desk.obey(7);
    Offscreen screen(800, 600);
    const Image image = screen.settle(desk.bench);
    if (i == 0) first = image.rgb;
    EXPECT_EQ(image.rgb, first);
  }
}

TEST_F(OffscreenTest, ComesToRestInEverySize) {
  Desk desk(debugger::test::kCounting);
  for (int height = 360; height < 700; height += 50) {
    Offscreen screen(640, height);
    const Image first = screen.settle(desk.bench);
    EXPECT_EQ(screen.draw(desk.bench).rgb, first.rgb) << height;
  }
}

TEST_F(OffscreenTest, AClickOnASmallRegisterShowsItLarge) {
  Desk desk(kCorner);
  Offscreen screen(kWidth, kHeight);
  screen.settle(desk.bench);
  EXPECT_EQ(desk.bench.selected(), std::size_t{0});
  click(screen, desk, 200.0F, 130.0F);  // the second one
  EXPECT_EQ(desk.bench.selected(), std::size_t{1});
  EXPECT_EQ(screen.take_error(), 0U);
}

TEST_F(OffscreenTest, ButtonsAndKeysDriveTheProgram) {
  Desk desk(debugger::test::kCounting);
  Offscreen screen(kWidth, kHeight);
  screen.settle(desk.bench);
  click(screen, desk, 112.0F, 20.0F);  // Tick
  EXPECT_EQ(desk.bench.look().ticks, 1U);
  const std::uint64_t executed = desk.session->vm().instructions_executed();
  screen.point(-1.0F, -1.0F);
  screen.type('i');
  screen.draw(desk.bench);
  desk.obey();
  EXPECT_EQ(desk.session->vm().instructions_executed(), executed + 1);
  click(screen, desk, 40.0F, 20.0F);  // Run
  EXPECT_TRUE(desk.bench.running());
  click(screen, desk, 40.0F, 20.0F);  // Stop
  EXPECT_FALSE(desk.bench.running());
  screen.type('?');
  const Image help = screen.settle(desk.bench);
  EXPECT_TRUE(desk.bench.help_shown);
  EXPECT_EQ(screen.take_error(), 0U);
}

TEST_F(OffscreenTest, TheMouseZoomsAndPicksACell) {
  Desk desk(kCorner);
  desk.bench.step(debugger::Unit::kTick);
  desk.obey();
  Offscreen screen(kWidth, kHeight);
  const Box blue = find(screen.settle(desk.bench), 0, 0, 255, kListEnd, kHistogramTop);
  const auto y = static_cast<float>((blue.top + blue.bottom) / 2);
  const float inside = static_cast<float>(blue.left) + 200.0F;
  click(screen, desk, inside, y);
  EXPECT_GT(desk.bench.cell.x + desk.bench.cell.y, 0U);
  EXPECT_LT(desk.bench.cell.x, 8U);
  screen.point(inside, y, false, 3.0F);
  screen.draw(desk.bench);
  EXPECT_GT(desk.bench.view.zoom, 1.5F);
  EXPECT_EQ(screen.take_error(), 0U);
}

TEST_F(OffscreenTest, UploadsOnlyWhatIsInSightAndNew) {
  std::string many = "!register(A)\n";
  for (int i = 0; i < 60; ++i) many += "!register(R" + std::to_string(i) + ")\n";
  Desk desk(many + "A = 1\nsurface.step\n");
  Offscreen screen(kWidth, kHeight);
  screen.settle(desk.bench);
  desk.obey();
  screen.settle(desk.bench);
  const std::uint64_t first = screen.uploads();
  EXPECT_LT(first, 2U * 15U);  // about ten of 61 are in sight, in two looks
  EXPECT_GE(first, 8U);
  screen.settle(desk.bench);
  EXPECT_EQ(screen.uploads(), first) << "nothing is newer";
}

TEST_F(OffscreenTest, EverySizeAndScaleIsDrawnWithoutAnError) {
  Desk desk(debugger::test::kCounting);
  desk.bench.add_tick_breakpoint(3);
  desk.bench.profile_shown = true;
  desk.bench.cell_shown = true;
  desk.bench.set_profiling(true);
  desk.bench.run();
  desk.obey(4);
  for (const auto& [width, height, scale] :
       {std::tuple{640, 480, 1.0F}, {744, 760, 1.0F}, {1920, 1080, 1.0F}, {2560, 1600, 2.0F}}) {
    Offscreen screen(width, height, scale);
    const Image image = screen.settle(desk.bench);
    EXPECT_EQ(image.width, width);
    EXPECT_EQ(screen.take_error(), 0U) << width;
  }
  EXPECT_THROW(Offscreen(0, 100), PictureError);
  EXPECT_THROW(Offscreen(100, 10'000), PictureError);
}

TEST_F(OffscreenTest, AThousandFramesLeaveNothingBehind) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer keeps what was freed, and looks for leaks itself";
#endif
  Desk desk(kCorner);
  Offscreen screen(160, 120);
  const auto frames = [&](int count) {
    for (int i = 0; i < count; ++i) {
      if (i % 10 == 0) desk.obey(0);
      screen.draw(desk.bench);
    }
    return resident_pages();
  };
  const long begun = frames(100);
  EXPECT_LT(frames(1000) - begun, 512) << "pages of 4 KiB";
  EXPECT_EQ(screen.take_error(), 0U);
}

TEST(Film, AndPicturesAreWhatWasDrawn) {
  const std::filesystem::path folder = testing::TempDir();
  Image image{64, 32, std::vector<std::uint8_t>(64 * 32 * 3, 200)};
  image.rgb[0] = 10;
  const std::string file = folder / ("ui-" + std::to_string(getpid()) + ".png");
  write_png(file, image);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_file(&png, file.c_str()), 0);
  png.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> back(PNG_IMAGE_SIZE(png));
  ASSERT_NE(png_image_finish_read(&png, nullptr, back.data(), 0, nullptr), 0);
  EXPECT_EQ(back, image.rgb);
  std::filesystem::remove(file);
  EXPECT_THROW(write_png("/no/such/folder/a.png", image), PictureError);
  EXPECT_THROW(Film("film.avi", 64, 32, 30), PictureError);
  EXPECT_THROW(Film("/no/such/folder/film.mp4", 64, 32, 30), PictureError);
}

TEST(Film, IsWrittenWholeOrNotAtAll) {
  if (std::system("command -v ffmpeg > /dev/null") != 0) GTEST_SKIP() << "no ffmpeg";
  const std::filesystem::path file = testing::TempDir() + "ui-" + std::to_string(getpid()) + ".mp4";
  const Image image{64, 32, std::vector<std::uint8_t>(64 * 32 * 3, 200)};
  {
    Film film(file, 64, 32, 30);
    film.add(image);
  }
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_FALSE(std::filesystem::exists(file.string() + ".part.mp4"));
  {
    Film film(file, 64, 32, 30);
    for (int i = 0; i < 5; ++i) film.add(image);
    film.finish();
  }
  EXPECT_GT(std::filesystem::file_size(file), 200U);
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace apron::ui::test
