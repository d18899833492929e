#include "smartsurf/view/Image.h"

#include <gtest/gtest.h>
#include <png.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "smartsurf/scene/SceneSpec.h"

namespace smartsurf::view {
namespace {

class ImageFile : public testing::Test {
 protected:
  ImageFile() { std::filesystem::create_directories(folder_); }
  ~ImageFile() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("smartsurf-image-" + std::to_string(getpid()));
};

Image gradient(int width, int height) {
  Image image{width, height, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int value : {7 * x, 11 * y, 3 * (x + y)}) image.rgb.push_back(static_cast<std::uint8_t>(value));
  return image;
}

TEST_F(ImageFile, ComesBackFromThePngFileAsItWas) {
  const Image image = gradient(37, 21);
  const auto path = folder_ / "picture.png";
  write_png(path, image);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  ASSERT_TRUE(png_image_begin_read_from_file(&png, path.c_str())) << png.message;
  png.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> back(PNG_IMAGE_SIZE(png));
  ASSERT_TRUE(png_image_finish_read(&png, nullptr, back.data(), 0, nullptr)) << png.message;
  EXPECT_EQ(static_cast<int>(png.width), image.width);
  EXPECT_EQ(static_cast<int>(png.height), image.height);
  EXPECT_EQ(back, image.rgb);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "picture.png.part"));
}

TEST_F(ImageFile, AMissingFolderIsTheUsersMistakeInOneLineWithThePath) {
  const auto path = folder_ / "nowhere" / "picture.png";
  try {
    write_png(path, gradient(2, 2));
    FAIL() << "no error";
  } catch (const scene::InputError& error) {
    const std::string line = error.what();
    EXPECT_NE(line.find(path.string()), line.npos) << line;
    EXPECT_EQ(line.find('\n'), line.npos);
  }
}

TEST_F(ImageFile, AFailedWriteLeavesNothingBehind) {
  std::filesystem::create_directories(folder_ / "taken.png" / "inside");  // the name is a folder's
  EXPECT_THROW(write_png(folder_ / "taken.png", gradient(2, 2)), scene::InputError);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "taken.png.part"));
}

}  // namespace
}  // namespace smartsurf::view
