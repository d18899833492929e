// Cameras: pixel formats, and V4l2Camera against a fake driver.
#include <gtest/gtest.h>
#include <linux/videodev2.h>
#include <unistd.h>

#include <cerrno>
#include <deque>
#include <filesystem>
#include <fstream>
#include <map>

#include "apron/run/media/CameraSources.h"
#include "apron/run/media/CaptureFormat.h"
#include "apron/run/media/GreyFrame.h"
#include "apron/run/media/ImageCodec.h"
#include "apron/run/media/MediaError.h"
#include "apron/run/media/V4l2Camera.h"

namespace apron::run {
namespace {

using Bytes = std::vector<std::uint8_t>;

std::vector<float> resampled(const GreyFrame& frame, std::uint32_t width, std::uint32_t height) {
  std::vector<float> cells(std::size_t{width} * height);
  resample_center_crop(frame, {cells.data(), width, height, static_cast<std::ptrdiff_t>(width)});
  return cells;
}

TEST(GreyFrame, ResamplesCenterCrop) {
  const GreyFrame wide{6, 2, {9, 0, 10, 20, 40, 9, 9, 2, 30, 40, 60, 9}};
  EXPECT_EQ(resampled(wide, 1, 1), (std::vector<float>{25}));            // columns 2 and 3
  EXPECT_EQ(resampled(wide, 2, 1), (std::vector<float>{10.5F, 40.0F}));  // columns 1 to 4
  EXPECT_EQ(resampled(wide, 3, 1), (std::vector<float>{5, 25, 29.5F}));  // all columns
  EXPECT_EQ(resampled(GreyFrame{2, 1, {7, 8}}, 4, 2), (std::vector<float>{7, 7, 8, 8, 7, 7, 8, 8}));
  EXPECT_EQ(resampled(GreyFrame{1, 3, {1, 2, 3}}, 2, 2), (std::vector<float>{2, 2, 2, 2}));
}

std::optional<Bytes> to_grey(FourCc code, std::uint32_t line, const Bytes& bytes) {
  GreyFrame frame;
  if (!convert_to_grey({code, 2, 2, line}, bytes, frame)) return std::nullopt;
  EXPECT_EQ(frame.width, 2U);
  return frame.pixels;
}

TEST(CaptureFormat, ExtractsLuminanceFromEveryFormat) {
  const Bytes want{1, 2, 3, 4};
  EXPECT_EQ(to_grey(V4L2_PIX_FMT_GREY, 0, {1, 2, 3, 4}), want);
  EXPECT_EQ(to_grey(V4L2_PIX_FMT_GREY, 3, {1, 2, 99, 3, 4}), want);
  EXPECT_EQ(to_grey(V4L2_PIX_FMT_YUYV, 4, {1, 90, 2, 90, 3, 90, 4, 90}), want);
  EXPECT_EQ(to_grey(V4L2_PIX_FMT_UYVY, 6, {90, 1, 90, 2, 0, 0, 90, 3, 90, 4}), want);
  EXPECT_EQ(to_grey(V4L2_PIX_FMT_NV12, 2, {1, 2, 3, 4, 90, 90}), want);
  EXPECT_EQ(to_grey(V4L2_PIX_FMT_YUYV, 4, {1, 90, 2, 90, 3, 90, 4}), std::nullopt);
  EXPECT_EQ(fourcc_name(V4L2_PIX_FMT_YUYV), "YUYV");
}

// Removes the Huffman table segment (0xC4), which cameras omit.
Bytes without_tables(const std::string& jpeg) {
  const std::size_t at = jpeg.find("\xFF\xC4");
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(jpeg[i]); };
  const std::size_t length = 2U + (std::size_t{byte(at + 2)} << 8 | byte(at + 3));
  const std::string rest = jpeg.substr(0, at) + jpeg.substr(at + length);
  return {rest.begin(), rest.end()};
}

TEST(CaptureFormat, ReadsJpegWithAndWithoutHuffmanTables) {
  Bytes pixels;
  for (int i = 0; i < 32 * 16; ++i) pixels.push_back(static_cast<std::uint8_t>(i / 4));
  const std::string jpeg = encode_jpeg("", pixels, 32, 16);
  GreyFrame whole, bare;
  ASSERT_TRUE(convert_to_grey({V4L2_PIX_FMT_MJPEG, 32, 16, 0}, Bytes(jpeg.begin(), jpeg.end()), whole));
  const Bytes camera = without_tables(jpeg);
  ASSERT_LT(camera.size() + 400, jpeg.size());
  ASSERT_TRUE(convert_to_grey({V4L2_PIX_FMT_MJPEG, 32, 16, 0}, camera, bare));
  EXPECT_EQ(bare.pixels, whole.pixels);
  for (std::size_t i = 0; i < pixels.size(); ++i) EXPECT_NEAR(whole.pixels[i], pixels[i], 4);
  EXPECT_FALSE(convert_to_grey({V4L2_PIX_FMT_MJPEG, 32, 16, 0}, Bytes{0xFF, 0xD8, 0xFF}, bare));
  EXPECT_FALSE(convert_to_grey({V4L2_PIX_FMT_MJPEG, 32, 16, 0}, {}, bare));
}

// The driver state of a camera with 4x2 pixels.
struct FakeDriver {
  std::uint32_t capabilities = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING;
  std::vector<FourCc> formats = {V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_YUYV};
  std::optional<FourCc> forced_format;                 // overrides the requested format
  std::map<unsigned long, int> errors;                 // ioctl request -> errno
  std::deque<std::pair<Bytes, std::uint32_t>> frames;  // data and buffer flags
  int wait_error = ETIMEDOUT;

  std::vector<Bytes> memory;
  std::deque<std::uint32_t> queued;  // buffers that the driver may fill
  bool streaming = false, closed = false;
  int wait_count = 0;
};

class FakeV4l2Device final : public V4l2Device {
 public:
  explicit FakeV4l2Device(FakeDriver& driver) : driver_(driver) {}
  ~FakeV4l2Device() override { driver_.closed = true; }

  int control(unsigned long request, void* argument) override {
    if (const auto fail = driver_.errors.find(request); fail != driver_.errors.end()) return fail->second;
    switch (request) {
      case VIDIOC_QUERYCAP:
        static_cast<v4l2_capability*>(argument)->capabilities = V4L2_CAP_DEVICE_CAPS | V4L2_CAP_VIDEO_OUTPUT;
        static_cast<v4l2_capability*>(argument)->device_caps = driver_.capabilities;
        return 0;
      case VIDIOC_ENUM_FMT: {
        auto& offer = *static_cast<v4l2_fmtdesc*>(argument);
        if (offer.index >= driver_.formats.size()) return EINVAL;
        offer.pixelformat = driver_.formats[offer.index];
        return 0;
      }
      case VIDIOC_S_FMT: {
        v4l2_pix_format& format = static_cast<v4l2_format*>(argument)->fmt.pix;
        EXPECT_EQ(format.width, 640U);
        format.width = 4;
        format.height = 2;
        format.bytesperline = 8;
        if (driver_.forced_format) format.pixelformat = *driver_.forced_format;
        return 0;
      }
      case VIDIOC_REQBUFS:
        static_cast<v4l2_requestbuffers*>(argument)->count = 2;  // fewer than requested
        driver_.memory.assign(2, Bytes(64));
        return 0;
      case VIDIOC_QUERYBUF: {
        auto& buffer = *static_cast<v4l2_buffer*>(argument);
        buffer.length = 64;
        buffer.m.offset = 64 * buffer.index;
        return 0;
      }
      case VIDIOC_QBUF:
        driver_.queued.push_back(static_cast<v4l2_buffer*>(argument)->index);
        return 0;
      case VIDIOC_DQBUF:
        return fill(*static_cast<v4l2_buffer*>(argument));
      case VIDIOC_STREAMON:
        driver_.streaming = driver_.queued.size() == 2;
        return 0;
      case VIDIOC_STREAMOFF:
        driver_.streaming = false;
        return 0;
      default:
        return ENOTTY;
    }
  }
  std::span<const std::uint8_t> map(std::size_t bytes, std::int64_t offset) override {
    return {driver_.memory[static_cast<std::size_t>(offset) / 64].data(), bytes};
  }
  int wait(int) override {
    ++driver_.wait_count;
    return driver_.frames.empty() ? driver_.wait_error : 0;
  }

 private:
  int fill(v4l2_buffer& buffer) {
    if (driver_.frames.empty()) return EAGAIN;
    EXPECT_TRUE(driver_.streaming);
    buffer.index = driver_.queued.front();
    driver_.queued.pop_front();
    const auto& [bytes, flags] = driver_.frames.front();
    std::copy(bytes.begin(), bytes.end(), driver_.memory[buffer.index].begin());
    buffer.bytesused = static_cast<std::uint32_t>(bytes.size());
    buffer.flags = flags;
    driver_.frames.pop_front();
    return 0;
  }

  FakeDriver& driver_;
};

Bytes yuyv(std::uint8_t value) {
  Bytes bytes(16, 128);
  for (std::size_t i = 0; i < bytes.size(); i += 2) bytes[i] = value;
  return bytes;
}

class V4l2CameraTest : public testing::Test {
 protected:
  std::unique_ptr<V4l2Camera> open() {
    return std::make_unique<V4l2Camera>("cam", std::make_unique<FakeV4l2Device>(driver_));
  }
  float read(Camera& camera) {
    float cells[8] = {};
    camera.read({cells, 4, 2, 4}, stop_);
    EXPECT_EQ(cells[0], cells[7]);
    return cells[0];
  }
  std::string error_of() {
    try {
      open();
    } catch (const MediaError& error) {
      return error.what();
    }
    return "none";
  }
  FakeDriver driver_;
  std::atomic<bool> stop_{false};
};

TEST_F(V4l2CameraTest, ReadsLatestCompleteFrame) {
  const auto camera = open();
  EXPECT_TRUE(driver_.streaming);
  driver_.frames = {{yuyv(10), 0}, {yuyv(20), 0}};
  EXPECT_EQ(read(*camera), 20);
  driver_.frames = {{yuyv(30), 0}, {Bytes(3), 0}};
  EXPECT_EQ(read(*camera), 30);
  driver_.frames = {{yuyv(40), V4L2_BUF_FLAG_ERROR}, {Bytes(2), 0}, {yuyv(50), 0}};
  EXPECT_EQ(read(*camera), 50);
  EXPECT_EQ(driver_.queued.size(), 2U);
}

TEST_F(V4l2CameraTest, StopsStreamingAndClosesDevice) {
  open().reset();
  EXPECT_FALSE(driver_.streaming);
  EXPECT_TRUE(driver_.closed);
}

TEST_F(V4l2CameraTest, PrefersUncompressedFormats) {
  driver_.formats = {V4L2_PIX_FMT_MJPEG, V4L2_PIX_FMT_GREY, V4L2_PIX_FMT_YUYV};
  const auto camera = open();
  driver_.frames = {{Bytes(16, 9), 0}};  // lines of 4 pixels padded to 8 bytes
  EXPECT_EQ(read(*camera), 9);
}

TEST_F(V4l2CameraTest, ReportsUnsupportedDevices) {
  driver_.formats = {V4L2_PIX_FMT_H264, V4L2_PIX_FMT_RGB24};
  EXPECT_EQ(error_of(), "'cam' has no supported picture format; it has: H264, RGB3");
  driver_ = {};
  driver_.forced_format = V4L2_PIX_FMT_RGB24;
  EXPECT_EQ(error_of(), "'cam' sends pictures in the format RGB3, which is not supported");
  driver_ = {};
  driver_.capabilities = V4L2_CAP_META_CAPTURE | V4L2_CAP_STREAMING;
  EXPECT_EQ(error_of(), "'cam' is a video device that does not capture pictures");
  driver_.capabilities = V4L2_CAP_VIDEO_CAPTURE;
  EXPECT_EQ(error_of(), "'cam' is a camera that does not stream, which is not supported");
  driver_ = {};
  driver_.errors[VIDIOC_QUERYCAP] = ENOTTY;
  EXPECT_EQ(error_of(), "'cam' is not a camera");
  driver_ = {};
  driver_.errors[VIDIOC_S_FMT] = EBUSY;
  EXPECT_EQ(error_of(), "cannot set the format of the camera 'cam': another program uses it");
  driver_ = {};
  driver_.errors[VIDIOC_STREAMON] = ENOSPC;
  EXPECT_EQ(error_of(), "cannot start the camera 'cam': No space left on device");
  EXPECT_TRUE(driver_.closed);
}

TEST_F(V4l2CameraTest, TimesOutAndCanBeInterrupted) {
  const auto camera = open();
  EXPECT_THROW(read(*camera), MediaError);
  EXPECT_EQ(driver_.wait_count, 100);
  driver_.wait_error = ENODEV;
  EXPECT_THROW(read(*camera), MediaError);
  EXPECT_EQ(driver_.wait_count, 101);
  stop_ = true;
  try {
    read(*camera);
    FAIL();
  } catch (const MediaError& error) {
    EXPECT_EQ(error.status(), vm::HostStatus::kInterrupted);
  }
  EXPECT_EQ(driver_.wait_count, 101);
}

std::string open_error(const std::string& path) {
  try {
    open_camera(path);
  } catch (const MediaError& error) {
    EXPECT_EQ(error.status(), vm::HostStatus::kRefused);
    return error.what();
  }
  return "none";
}

TEST(Camera, OpensDeviceOrVideo) {
  const std::string file =
      (std::filesystem::path(testing::TempDir()) / ("camera_" + std::to_string(getpid()))).string();
  EXPECT_EQ(open_error(file),
            "there is no camera '" + file + "'; select another one, or a .y4m video, with --camera");
  std::ofstream(file) << "text";
  EXPECT_EQ(open_error(file), "'" + file + "' is not a camera; the name of a video must end in .y4m");
  EXPECT_EQ(open_error("/dev/null"), "'/dev/null' is not a camera");
  std::filesystem::rename(file, file + ".y4m");
  std::ofstream(file + ".y4m") << "YUV4MPEG2 W4 H2 Cmono\nFRAME\nabcdefgh";
  const auto camera = open_camera(file + ".y4m");
  float cells[2] = {};
  camera->read({cells, 2, 1, 2}, std::atomic<bool>{false});
  EXPECT_EQ(cells[0], ('a' + 'b' + 'e' + 'f') / 4.0F);
  std::filesystem::remove(file + ".y4m");
}

TEST(Camera, ShowsPicturesOfAFolderInTurn) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(testing::TempDir()) / ("pictures_" + std::to_string(getpid()));
  fs::create_directories(folder);
  EXPECT_NE(open_error(folder.string()).find("has no picture"), std::string::npos);
  std::ofstream(folder / "b.pgm") << "P2 2 2 255  10 20 30 40";
  std::ofstream(folder / "a.pgm") << "P2 1 1 100  50";  // 127.5, rounded
  std::ofstream(folder / "notes.txt") << "text";
  float cell = 0;
  const auto read_next = [&cell](Camera& camera) {
    camera.read({&cell, 1, 1, 1}, std::atomic<bool>{false});
    return cell;
  };
  const auto camera = open_camera(folder.string());
  EXPECT_EQ(read_next(*camera), 128.0F);
  EXPECT_EQ(read_next(*camera), 25.0F);
  EXPECT_EQ(read_next(*camera), 128.0F);
  const auto still = open_camera((folder / "b.pgm").string());
  EXPECT_EQ(read_next(*still), 25.0F);
  EXPECT_EQ(read_next(*still), 25.0F);
  std::ofstream(folder / "a.pgm") << "P5 99999 99999 255 ";
  EXPECT_THROW(read_next(*open_camera((folder / "a.pgm").string())), MediaError);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace apron::run
