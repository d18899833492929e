#include <gtest/gtest.h>
#include <png.h>

#include "common/error/UserError.h"
#include "common/image/PixelSize.h"
#include "common/image/Png.h"
#include "tests/unit/common/TemporaryFolder.h"

using namespace common;

namespace {

TEST(Png, RoundTrips) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "a.png";
  const Image image{2, 1, {1, 2, 3, 250, 251, 252}};
  write_png(path, image);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  ASSERT_NE(png_image_begin_read_from_file(&png, path.c_str()), 0);
  png.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> rgb(PNG_IMAGE_SIZE(png));
  ASSERT_NE(png_image_finish_read(&png, nullptr, rgb.data(), 0, nullptr), 0);
  EXPECT_EQ(rgb, image.rgb);
  EXPECT_EQ(folder.entries(), 1);
  const Image read = read_png(path);
  EXPECT_EQ(read.width, 2);
  EXPECT_EQ(read.height, 1);
  EXPECT_EQ(read.rgb, image.rgb);
}

TEST(Png, RefusesWhatIsNotAPicture) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "a.png";
  EXPECT_THROW(static_cast<void>(read_png(path)), UserError);
  write_png(path, {2, 1, {1, 2, 3, 250, 251, 252}});
  const auto size = std::filesystem::file_size(path);
  for (std::uintmax_t bytes = 0; bytes < size - 12; bytes += 5) {  // the last chunk is empty
    std::filesystem::resize_file(path, bytes);
    EXPECT_THROW(static_cast<void>(read_png(path)), UserError) << bytes;
    write_png(path, {2, 1, {1, 2, 3, 250, 251, 252}});
  }
}

TEST(Png, ErrorNamesTheFile) {
  try {
    write_png("/nonexistent/a.png", {1, 1, {0, 0, 0}});
    FAIL();
  } catch (const UserError& error) {
    EXPECT_EQ(std::string(error.what()).find("/nonexistent/a.png: cannot write this picture: "), 0U);
  }
}

TEST(PixelSize, ParsesWidthAndHeightOnly) {
  const auto size = parse_size("1280x720");
  ASSERT_TRUE(size);
  EXPECT_EQ(size->width, 1280);
  EXPECT_EQ(size->height, 720);
  for (const char* text : {"", "x", "10", "10x", "x10", "0x10", "-1x10", "10x10x10", "1e2x3"})
    EXPECT_FALSE(parse_size(text)) << text;
}

}  // namespace
