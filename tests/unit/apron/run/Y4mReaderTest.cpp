// Reading of YUV4MPEG2 videos: frames, looping, formats and damaged files.
#include "apron/run/media/Y4mReader.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "apron/run/media/MediaError.h"

namespace apron::run {
namespace {

class Y4mReaderTest : public testing::Test {
 protected:
  void SetUp() override {
    file_ =
        (std::filesystem::path(testing::TempDir()) / ("clip_" + std::to_string(getpid()) + ".y4m")).string();
  }
  void TearDown() override { std::filesystem::remove(file_); }
  void write_bytes(const std::string& bytes) const { std::ofstream(file_, std::ios::binary) << bytes; }
  std::string error(const std::string& bytes) const {
    write_bytes(bytes);
    try {
      float cells[6];
      Y4mReader clip(file_);
      clip.read_frame({cells, 3, 2, 3});
    } catch (const MediaError& media_error) {
      return std::string(media_error.what()).substr(file_.size() + 3);
    }
    return "none";
  }
  std::string file_;
};

TEST_F(Y4mReaderTest, ReadsFramesAndLoops) {
  write_bytes(std::string("YUV4MPEG2 W3 H2 F25:1 C420jpeg\nFRAME\nabcdef") + "uuvv" + "FRAME Ip\nABCDE\xFF" +
              "uuvv");
  Y4mReader clip(file_);
  float cells[2 * 16] = {};
  const vm::Plane to{cells, 3, 2, 16};
  clip.read_frame(to);
  EXPECT_EQ(cells[0], 'a');
  EXPECT_EQ(cells[2], 'c');
  EXPECT_EQ(cells[16], 'd');
  EXPECT_EQ(cells[3], 0);
  clip.read_frame(to);
  EXPECT_EQ(cells[18], 255);
  clip.read_frame(to);
  EXPECT_EQ(cells[0], 'a');
}

TEST_F(Y4mReaderTest, ReportsInvalidFiles) {
  EXPECT_EQ(error("YUV4MPEG2 W3 H2 Cmono\nFRAME\nabcdef"), "none");
  EXPECT_EQ(error("YUV4MPEG2 W4 H2 Cmono\nFRAME\nabcdefgh"), "is 4x2, but the register is 3x2");
  EXPECT_EQ(error("YUV4MPEG2 W65536 H65536\nFRAME\n"), "ends inside a frame");
  EXPECT_EQ(error("RIFF"), "is not a YUV4MPEG2 file");
  EXPECT_EQ(error("YUV4MPEG2 W3\n"), "does not state its width and height");
  EXPECT_EQ(error("YUV4MPEG2 W3 H-2\n"), "does not state its width and height");
  EXPECT_EQ(error("YUV4MPEG2 W3 H\n"), "does not state its width and height");
  EXPECT_EQ(error("YUV4MPEG2 W65537 H2\n"),
            "has the size W65537 in its header; at most 65536 columns and rows are read");
  EXPECT_EQ(error("YUV4MPEG2 W3 H99999999999\n"),
            "has the size H99999999999 in its header; at most 65536 columns and rows are read");
  EXPECT_EQ(error("YUV4MPEG2 W3 H2 C420p10\n"), "has colours in the format '420p10', which is not supported");
  EXPECT_EQ(error("YUV4MPEG2 W3 H2 Cmono\nFRAME\nabcd"), "ends inside a frame");
  EXPECT_EQ(error("YUV4MPEG2 W3 H2 Cmono\n"), "has no frame");
}

}  // namespace
}  // namespace apron::run
