// The window rendered without a display: layout, mouse and keyboard input.
#include "apron/ui/window/OffscreenRenderer.h"

#include <gtest/gtest.h>
#include <png.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "common/error/UserError.h"
#include "common/image/Png.h"
#include "common/video/VideoEncoder.h"
#include "tests/unit/apron/ui/UiFixture.h"

namespace apron::ui::test {
namespace {

constexpr int kWidth = 1280, kHeight = 800;

bool is_near(const std::uint8_t* pixel, int red, int green, int blue) {
  return std::abs(pixel[0] - red) < 12 && std::abs(pixel[1] - green) < 12 && std::abs(pixel[2] - blue) < 12;
}

struct PixelBox {
  int left = kWidth, top = kHeight, right = -1, bottom = -1;
  int pixels = 0;
};
// The bounding box of all pixels of the colour.
PixelBox find_color(const common::Image& image, int red, int green, int blue, int from_x = 0,
                    int to_y = kHeight) {
  PixelBox box;
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

// All cells are blue, except the north-west one, which is red.
constexpr const char* kCorner = R"(!register(A, B)
reg.setPalette(A, 'spectrum')
reg.setScale(A, 0, 1)
pixel.set(A, 0, 0, 1)
surface.step
)";
constexpr int kListEnd = 302;       // x of the register list's right edge
constexpr int kHistogramTop = 440;  // y above the histogram

long resident_pages() {
  long all = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> all >> resident;
  return resident;
}

class OffscreenRendererTest : public testing::Test {
 protected:
  static void click(OffscreenRenderer& screen, UiFixture& fixture, float x, float y) {
    screen.set_mouse(x, y);
    screen.render(fixture.model);
    screen.set_mouse(x, y, true);
    screen.render(fixture.model);
    screen.set_mouse(x, y, false);
    screen.render(fixture.model);
    fixture.process_commands();
  }
};

// Two tiles side by side; a click on the right one selects it as the large register.
TEST_F(OffscreenRendererTest, DrawsTilesSideBySide) {
  UiFixture fixture(
      "!register(A, B)\nreg.setPalette(A, 'spectrum')\nreg.setScale(A, 0, 1)\nreg.setPalette(B, 'spectrum')\n"
      "reg.setScale(B, -1, 0)\nsim.display(A, 'low')\nsim.display(B, 'high')\nsim.tile\nsurface.step\n");
  fixture.model.step(debugger::StepUnit::kTick);
  fixture.process_commands();
  fixture.process_commands();
  OffscreenRenderer screen(kWidth, kHeight);
  const common::Image image = screen.render_settled(fixture.model);
  const PixelBox blue = find_color(image, 0, 0, 255, kListEnd), red = find_color(image, 255, 0, 0, kListEnd);
  EXPECT_GT(blue.pixels, 20000);
  EXPECT_EQ(red.pixels, blue.pixels);
  EXPECT_GT(red.left, blue.right);
  EXPECT_EQ(red.top, blue.top);
  click(screen, fixture, static_cast<float>(red.left + red.right) / 2.0F,
        static_cast<float>(red.top + red.bottom) / 2.0F);
  EXPECT_FALSE(fixture.model.tiled());
  EXPECT_EQ(fixture.model.selected(), std::size_t{1});
  EXPECT_EQ(screen.take_gl_error(), 0U);
}

TEST_F(OffscreenRendererTest, DrawsNorthWestCellAtTopLeft) {
  UiFixture fixture(kCorner);
  fixture.model.step(debugger::StepUnit::kTick);
  fixture.process_commands();
  OffscreenRenderer screen(kWidth, kHeight);
  const common::Image image = screen.render_settled(fixture.model);
  const PixelBox blue = find_color(image, 0, 0, 255, kListEnd, kHistogramTop),
                 red = find_color(image, 255, 0, 0, kListEnd, kHistogramTop);
  ASSERT_GT(blue.pixels, 20000);
  // The legend has the same colours, but lies further to the right.
  EXPECT_NEAR(red.left, blue.left, 3);
  EXPECT_LT(red.top, blue.top + 3);
  const int edge = (blue.right - blue.left) / 8;
  EXPECT_TRUE(is_near(image.pixel(red.left + edge / 2, red.top + edge / 2), 255, 0, 0));
  EXPECT_TRUE(is_near(image.pixel(red.left + edge / 2, red.top + edge + edge / 2), 0, 0, 255));
  EXPECT_TRUE(is_near(image.pixel(red.left + edge + edge / 2, red.top + edge / 2), 0, 0, 255));
  EXPECT_EQ(screen.take_gl_error(), 0U);
}

// On a table of hexagons the register is drawn as such: pixels have the colour of the cell at that point, and
// a click selects it.
TEST_F(OffscreenRendererTest, DrawsHexagons) {
  for (const bool first_row_shifted : {false, true}) {
    UiFixture fixture(
        "!register(A)\nreg.setPalette(A, 'spectrum')\nreg.setScale(A, 0, 1)\n"
        "A = mod(cell.x + cell.y, 2)\nsurface.step\n");
    const program::Register& r = fixture.model.program().registers[*fixture.model.find_register("A")];
    const CellLayout layout = CellLayout::hexagons(first_row_shifted);
    fixture.model.set_surface_layout(layout, r.width, r.height);
    fixture.model.step(debugger::StepUnit::kTick);
    fixture.process_commands();
    OffscreenRenderer screen(kWidth, kHeight);
    const common::Image image = screen.render_settled(fixture.model);
    const PixelBox blue = find_color(image, 0, 0, 255, kListEnd, kHistogramTop),
                   red = find_color(image, 255, 0, 0, kListEnd, kHistogramTop);
    ASSERT_GT(blue.pixels, 5000);
    // The legend has both colours, too: the register's own edge is in the west and the north.
    const auto left = static_cast<float>(std::min(blue.left, red.left)),
               top = static_cast<float>(std::min(blue.top, red.top));
    const float edge =
        static_cast<float>(std::max(blue.bottom, red.bottom) + 1 - top) / layout.extent(r.width, r.height).y;
    for (std::uint32_t y = 0; y < r.height; ++y)
      for (std::uint32_t x = 0; x < r.width; ++x) {
        const CellPoint centre = layout.centre({x, y});
        for (const CellPoint& corner : CellLayout::hexagon()) {
          const auto px = static_cast<int>(left + edge * (centre.x + 0.8F * corner.x)),
                     py = static_cast<int>(top + edge * (centre.y + 0.8F * corner.y));
          const bool is_red = (x + y) % 2 == 1;
          EXPECT_TRUE(is_near(image.pixel(px, py), is_red ? 255 : 0, 0, is_red ? 0 : 255)) << x << ' ' << y;
        }
      }
    const CellPoint picked = layout.centre({r.width - 1, 1});
    click(screen, fixture, left + edge * picked.x, top + edge * (picked.y - 0.45F));
    EXPECT_EQ(fixture.model.probed_cell, (debugger::Cell{r.width - 1, 1}));
    EXPECT_EQ(screen.take_gl_error(), 0U);
  }
}

TEST_F(OffscreenRendererTest, RenderingIsDeterministic) {
  std::vector<std::uint8_t> first;
  for (int i = 0; i < 2; ++i) {
    UiFixture fixture(debugger::test::kCounting);
    fixture.model.run();
    fixture.process_commands(7);
    OffscreenRenderer screen(800, 600);
    const common::Image image = screen.render_settled(fixture.model);
    if (i == 0) first = image.rgb;
    EXPECT_EQ(image.rgb, first);
  }
}

TEST_F(OffscreenRendererTest, SettlesAtEverySize) {
  UiFixture fixture(debugger::test::kCounting);
  for (int height = 360; height < 700; height += 50) {
    OffscreenRenderer screen(640, height);
    const common::Image first = screen.render_settled(fixture.model);
    EXPECT_EQ(screen.render(fixture.model).rgb, first.rgb) << height;
  }
}

TEST_F(OffscreenRendererTest, ClickOnThumbnailSelectsRegister) {
  UiFixture fixture(kCorner);
  OffscreenRenderer screen(kWidth, kHeight);
  screen.render_settled(fixture.model);
  EXPECT_EQ(fixture.model.selected(), std::size_t{0});
  click(screen, fixture, 200.0F, 130.0F);  // the second register
  EXPECT_EQ(fixture.model.selected(), std::size_t{1});
  EXPECT_EQ(screen.take_gl_error(), 0U);
}

TEST_F(OffscreenRendererTest, ButtonsAndKeysControlProgram) {
  UiFixture fixture(debugger::test::kCounting);
  OffscreenRenderer screen(kWidth, kHeight);
  screen.render_settled(fixture.model);
  click(screen, fixture, 112.0F, 20.0F);  // Tick
  EXPECT_EQ(fixture.model.snapshot().ticks, 1U);
  const std::uint64_t executed = fixture.session->vm().instructions_executed();
  screen.set_mouse(-1.0F, -1.0F);
  screen.type_character('i');
  screen.render(fixture.model);
  fixture.process_commands();
  EXPECT_EQ(fixture.session->vm().instructions_executed(), executed + 1);
  click(screen, fixture, 40.0F, 20.0F);  // Run
  EXPECT_TRUE(fixture.model.running());
  click(screen, fixture, 40.0F, 20.0F);  // Stop
  EXPECT_FALSE(fixture.model.running());
  screen.type_character('?');
  const common::Image help = screen.render_settled(fixture.model);
  EXPECT_TRUE(fixture.model.help_shown);
  EXPECT_EQ(screen.take_gl_error(), 0U);
}

TEST_F(OffscreenRendererTest, MouseZoomsAndProbesCell) {
  UiFixture fixture(kCorner);
  fixture.model.step(debugger::StepUnit::kTick);
  fixture.process_commands();
  OffscreenRenderer screen(kWidth, kHeight);
  const PixelBox blue = find_color(screen.render_settled(fixture.model), 0, 0, 255, kListEnd, kHistogramTop);
  const auto y = static_cast<float>((blue.top + blue.bottom) / 2);
  const float inside = static_cast<float>(blue.left) + 200.0F;
  click(screen, fixture, inside, y);
  EXPECT_GT(fixture.model.probed_cell.x + fixture.model.probed_cell.y, 0U);
  EXPECT_LT(fixture.model.probed_cell.x, 8U);
  screen.set_mouse(inside, y, false, 3.0F);
  screen.render(fixture.model);
  EXPECT_GT(fixture.model.viewport.zoom, 1.5F);
  EXPECT_EQ(screen.take_gl_error(), 0U);
}

// Dragging the gap between register list and large register; a double click restores the default.
TEST_F(OffscreenRendererTest, DraggedGapResizesPanes) {
  UiFixture fixture(kCorner);
  OffscreenRenderer screen(kWidth, kHeight);
  const common::Image before = screen.render_settled(fixture.model);
  const float gap = 304.0F, y = 400.0F;
  for (const auto& [x, down] : {std::pair{gap, false},
                                {gap, true},
                                {gap + 40.0F, true},
                                {gap + 100.0F, true},
                                {gap + 100.0F, false}}) {
    screen.set_mouse(x, y, down);
    screen.render(fixture.model);
  }
  EXPECT_NEAR(fixture.model.layout.wide.registers, 392.0F, 6.0F);
  EXPECT_NE(screen.render_settled(fixture.model).rgb, before.rgb);
  for (const bool down : {true, false, true, false}) {
    screen.set_mouse(gap + 100.0F, y, down);
    screen.render(fixture.model);
  }
  EXPECT_EQ(fixture.model.layout, PaneLayout());
}

// Panes of any remembered size leave room for the others.
TEST_F(OffscreenRendererTest, RemembersNoSizeThatDoesNotFit) {
  UiFixture fixture(kCorner);
  const PaneSizes huge{9000.0F, 9000.0F, 9000.0F, 9000.0F}, tiny{1.0F, 1.0F, 1.0F, 1.0F};
  for (const PaneSizes& sizes : {huge, tiny}) {
    fixture.model.layout = {sizes, sizes};
    for (const int width : {640, kWidth}) {
      OffscreenRenderer screen(width, 480);
      const common::Image first = screen.render_settled(fixture.model);
      EXPECT_EQ(screen.render(fixture.model).rgb, first.rgb) << width;
      EXPECT_EQ(screen.take_gl_error(), 0U);
    }
  }
}

// The editor shows the text in place of the listing and marks the lines of errors in red.
TEST_F(OffscreenRendererTest, EditorMarksLinesOfErrors) {
  UiFixture fixture(kCorner);
  OffscreenRenderer screen(kWidth, kHeight);
  fixture.model.editor.shown = true;
  const auto marked = [&] {
    return find_color(screen.render_settled(fixture.model), 242, 213, 214, 800).pixels;
  };
  EXPECT_EQ(marked(), 0);
  fixture.model.editor.diagnostics = {{fixture.model.editor.current()->name, 2, 1, "no such palette", false}};
  EXPECT_GT(marked(), 2000);
  EXPECT_EQ(screen.take_gl_error(), 0U);
}

// ImGui's texts have characters of 16 bits.
TEST_F(OffscreenRendererTest, EditorKeepsWhatItCannotShow) {
  for (const auto& [comment, line] : {std::pair<std::string, unsigned>{"// \u00E9 \u042F \u2713", 0},
                                      {"// \U0001F600 \U0001D6FC", 3},
                                      {"// \xE9", 3},
                                      {std::string("// \0", 4), 3}}) {
    UiFixture fixture("!register(A)\nA = 1\n");
    ProgramEditor& editor = fixture.model.editor;
    const std::string text = "!register(A)\nA = 1\n" + comment + "\n";
    editor.set_text_on_disk(editor.current()->name, text);
    EXPECT_EQ(editor.current()->uneditable_line(), line);
    editor.open(editor.current()->name, 1);
    OffscreenRenderer screen(kWidth, kHeight);
    screen.render_settled(fixture.model);
    click(screen, fixture, 1000.0F, 200.0F);
    for (const char typed : {'x', 'y'}) {
      screen.type_character(typed);
      screen.render(fixture.model);
    }
    const std::string edited = editor.current()->text;
    EXPECT_EQ(edited == text, line > 0) << edited;
    EXPECT_EQ(edited.size(), text.size() + (line > 0 ? 0 : 2));
  }
}

TEST_F(OffscreenRendererTest, ListingShowsGreekAndCyrillicLetters) {
  std::vector<std::vector<std::uint8_t>> seen;
  for (const char* letter : {"\u0416", "\u042F", "\u03A9", "\u03A8"}) {
    UiFixture fixture(std::string("!register(A)\n// ") + letter + "\nA = 1\n");
    OffscreenRenderer screen(kWidth, kHeight);
    seen.push_back(screen.render_settled(fixture.model).rgb);
    for (std::size_t i = 0; i + 1 < seen.size(); ++i) EXPECT_NE(seen[i], seen.back()) << letter;
  }
}

TEST_F(OffscreenRendererTest, UploadsOnlyVisibleAndChangedTextures) {
  std::string many = "!register(A)\n";
  for (int i = 0; i < 60; ++i) many += "!register(R" + std::to_string(i) + ")\n";
  UiFixture fixture(many + "A = 1\nsurface.step\n");
  OffscreenRenderer screen(kWidth, kHeight);
  screen.render_settled(fixture.model);
  fixture.process_commands();
  screen.render_settled(fixture.model);
  const std::uint64_t first = screen.texture_uploads();
  EXPECT_LT(first, 2U * 15U);  // about ten of 61 are visible, in two snapshots
  EXPECT_GE(first, 8U);
  screen.render_settled(fixture.model);
  EXPECT_EQ(screen.texture_uploads(), first) << "nothing has changed";
}

TEST_F(OffscreenRendererTest, DrawsEverySizeAndScaleWithoutError) {
  UiFixture fixture(debugger::test::kCounting);
  fixture.model.add_tick_breakpoint(3);
  fixture.model.profile_shown = true;
  fixture.model.probe_shown = true;
  fixture.model.set_profiling(true);
  fixture.model.run();
  fixture.process_commands(4);
  for (const auto& [width, height, scale] :
       {std::tuple{640, 480, 1.0F}, {744, 760, 1.0F}, {1920, 1080, 1.0F}, {2560, 1600, 2.0F}}) {
    OffscreenRenderer screen(width, height, scale);
    const common::Image image = screen.render_settled(fixture.model);
    EXPECT_EQ(image.width, width);
    EXPECT_EQ(screen.take_gl_error(), 0U) << width;
  }
  EXPECT_THROW(OffscreenRenderer(0, 100), common::UserError);
  EXPECT_THROW(OffscreenRenderer(100, 10'000), common::UserError);
}

TEST_F(OffscreenRendererTest, ThousandFramesDoNotLeakMemory) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer quarantines freed memory and detects leaks itself";
#endif
  UiFixture fixture(kCorner);
  OffscreenRenderer screen(160, 120);
  const auto frames = [&](int count) {
    for (int i = 0; i < count; ++i) {
      if (i % 10 == 0) fixture.process_commands(0);
      screen.render(fixture.model);
    }
    return resident_pages();
  };
  const long begun = frames(100);
  EXPECT_LT(frames(1000) - begun, 512) << "pages of 4 KiB";
  EXPECT_EQ(screen.take_gl_error(), 0U);
}

TEST(VideoEncoder, WritesPictureAndRejectsInvalidPaths) {
  const std::filesystem::path folder = testing::TempDir();
  common::Image image{64, 32, std::vector<std::uint8_t>(64 * 32 * 3, 200)};
  image.rgb[0] = 10;
  const std::string file = folder / ("ui-" + std::to_string(getpid()) + ".png");
  common::write_png(file, image);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_file(&png, file.c_str()), 0);
  png.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> back(PNG_IMAGE_SIZE(png));
  ASSERT_NE(png_image_finish_read(&png, nullptr, back.data(), 0, nullptr), 0);
  EXPECT_EQ(back, image.rgb);
  std::filesystem::remove(file);
  EXPECT_THROW(common::write_png("/no/such/folder/a.png", image), common::UserError);
  EXPECT_THROW(common::VideoEncoder("film.avi", 64, 32, 30), common::UserError);
  EXPECT_THROW(common::VideoEncoder("/no/such/folder/film.mp4", 64, 32, 30), common::UserError);
}

TEST(VideoEncoder, WritesCompleteVideoOrNothing) {
  if (std::system("command -v ffmpeg > /dev/null") != 0) GTEST_SKIP() << "no ffmpeg";
  const std::filesystem::path file = testing::TempDir() + "ui-" + std::to_string(getpid()) + ".mp4";
  const common::Image image{64, 32, std::vector<std::uint8_t>(64 * 32 * 3, 200)};
  {
    common::VideoEncoder encoder(file, 64, 32, 30);
    encoder.add(image);
  }
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_FALSE(std::filesystem::exists(file.string() + ".part.mp4"));
  {
    common::VideoEncoder encoder(file, 64, 32, 30);
    for (int i = 0; i < 5; ++i) encoder.add(image);
    encoder.finish();
  }
  EXPECT_GT(std::filesystem::file_size(file), 200U);
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace apron::ui::test
