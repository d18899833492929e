// Videos drawn on several threads, through a stand-in for ffmpeg that keeps the raw pictures.
#include "smartsurf/run/output/MediaWriter.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "common/error/UserError.h"
#include "smartsurf/run/display/ViewChannels.h"
#include "smartsurf/view/output/VideoCapture.h"

namespace smartsurf::run {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 160, kHeight = 90;
constexpr std::size_t kPictureBytes = std::size_t{3} * kWidth * kHeight;

class VideoWriterTest : public testing::Test {
 protected:
  void SetUp() override {
    try {
      view::OffscreenView::require_available();
      const view::OffscreenView view{scene_};
    } catch (const std::exception& error) {
      GTEST_SKIP() << error.what();
    }
    std::string name = (fs::temp_directory_path() / "video-test-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
    std::ofstream(folder_ / "ffmpeg") << "#!/bin/sh\nfor last; do :; done\nexec cat > \"$last\"\n";
    fs::permissions(folder_ / "ffmpeg", fs::perms::owner_all);
    old_path_ = std::getenv("PATH");
    ::setenv("PATH", (folder_.string() + ":" + old_path_).c_str(), 1);
    scene_.surface.rows = scene_.surface.columns = 12;
    for (int i = 0; i < 6; ++i) add_object();
  }
  void TearDown() override {
    if (folder_.empty()) return;
    ::setenv("PATH", old_path_.c_str(), 1);
    fs::remove_all(folder_);
  }

  void add_object() {
    scene::ObjectSpec object;
    object.radius = 0.8;
    object.colour = {0.9F, 0.1F * static_cast<float>(catalogue_.size() % 9), 0.2F};
    catalogue_.push_back(object);
  }

  // Frames with a moving table and objects of which one is added on the way.
  std::string video(int threads, const RenderOptions& options, int frames = 40, double start_s = 0.0,
                    double period_s = 1.0 / 60.0) {
    const fs::path file = folder_ / "video.mp4";
    catalogue_.resize(6);
    MediaWriter media({}, start_video(file.string(), options), options, scene_, threads);
    for (int t = 0; t < frames; ++t) {
      if (t == 20) add_object();
      scene::Snapshot shot;
      shot.tick = static_cast<std::uint64_t>(t);
      shot.time_s = start_s + t * period_s;
      for (int cell = 0; cell < scene_.surface.cell_count(); ++cell)
        shot.height.push_back(0.5F + 0.5F * std::sin(0.3F * static_cast<float>(cell + 5 * t)));
      for (scene::ObjectId id = 0; id < catalogue_.size(); ++id) {
        shot.id.push_back(id);
        shot.position.push_back({1.5F * static_cast<float>(id), 5.0F + 0.1F * static_cast<float>(t), 2.0F});
        shot.orientation.push_back({0.0F, 0.0F, 0.0F, 1.0F});
        shot.velocity.push_back({});
        shot.angular_velocity.push_back({});
      }
      view::Channel channel = height_channel(scene_.surface);
      channel.values = shot.height;
      const bool is_last = t + 1 == frames;
      media.write_due({shot, catalogue_, {&channel, 1}},
                      is_last ? std::nullopt : std::optional(start_s + (t + 1) * period_s));
      if (is_last) media.finish({shot, catalogue_, {&channel, 1}});
    }
    return pictures(file);
  }

  static std::string pictures(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  static RenderOptions plain() {
    RenderOptions options;
    options.pixel_size = common::PixelSize{kWidth, kHeight};
    return options;
  }

  scene::SceneSpec scene_;
  std::vector<scene::ObjectSpec> catalogue_;
  fs::path folder_;
  std::string old_path_;
};

TEST_F(VideoWriterTest, BytesDoNotDependOnThreads) {
  RenderOptions rich = plain();
  rich.view.overlay.channel = "height";
  rich.view.overlay.trails = true;
  for (const RenderOptions& options : {plain(), rich}) {
    const std::string serial = video(1, options);
    EXPECT_EQ(serial.size(), 20 * kPictureBytes);
    EXPECT_NE(serial.substr(0, kPictureBytes), serial.substr(10 * kPictureBytes, kPictureBytes));
    for (const int threads : {2, 5}) EXPECT_TRUE(video(threads, options) == serial) << threads << " threads";
  }
}

// A live recording may begin at any time and hold any interval.
TEST_F(VideoWriterTest, EachPictureShowsTheLatestFrameSinceTheFirst) {
  const std::string all = video(2, plain(), 4, 14.09, 0.1);
  ASSERT_EQ(all.size(), 10 * kPictureBytes);
  for (std::size_t i = 1; i < 10; ++i)
    EXPECT_EQ(all.compare(i * kPictureBytes, kPictureBytes, all, (i - 1) * kPictureBytes, kPictureBytes) != 0,
              i % 3 == 0)
        << i;
}

TEST_F(VideoWriterTest, WindowRepeatsThePictureBeforeALateOne) {
  const fs::path file = folder_ / "window.mp4";
  view::VideoCapture capture(file.string(), 2, 2, 3.0);
  for (const auto& [time_s, value] : {std::pair{3.0, 10}, {3.1, 20}, {3.11, 30}, {3.2, 40}})
    if (capture.frame_due(time_s))
      capture.add({2, 2, std::vector<std::uint8_t>(12, static_cast<std::uint8_t>(value))}, time_s);
  capture.finish();
  std::string shown;
  const std::string bytes = pictures(file);
  for (std::size_t i = 0; i < bytes.size(); i += 12) shown += std::to_string(bytes[i]) + ' ';
  EXPECT_EQ(shown, "10 10 10 20 20 20 40 ");
}

TEST_F(VideoWriterTest, ErrorsOfDrawingReachTheCaller) {
  RenderOptions options = plain();
  options.pixel_size = common::PixelSize{16384, 2};
  EXPECT_THROW(video(3, options), scene::InputError);
  EXPECT_FALSE(fs::exists(folder_ / "video.mp4"));
}

TEST_F(VideoWriterTest, AnEncoderThatStopsEndsTheVideo) {
  std::ofstream(folder_ / "ffmpeg") << "#!/bin/sh\nexit 1\n";
  EXPECT_THROW(video(3, plain(), 400), common::UserError);
  EXPECT_FALSE(fs::exists(folder_ / "video.mp4"));
}

}  // namespace
}  // namespace smartsurf::run
