#include <gtest/gtest.h>
#include <sys/wait.h>

#include <csignal>
#include <cstdlib>

#include "smartsurf/record/OpenRecorder.h"
#include "smartsurf/record/Recording.h"
#include "tests/unit/common/SanitizedCases.h"
#include "tests/unit/smartsurf/record/SyntheticRun.h"

namespace smartsurf::record {
namespace {

// A child process that records frames until it is killed and writes a byte to a pipe after each. After
// `max_frames` it pauses with the file open.
class KilledWriterProcess {
 public:
  KilledWriterProcess(const std::filesystem::path& path, const SyntheticRun& run,
                      std::uint64_t max_frames = 1u << 30) {
    EXPECT_EQ(::pipe(pipe_), 0);
    child_ = ::fork();
    if (child_ == 0) write(path, run, max_frames);
    ::close(pipe_[1]);
  }
  ~KilledWriterProcess() { ::close(pipe_[0]); }

  void wait_for_frames(int frames) {
    for (char c; frames > 0; --frames) ASSERT_EQ(::read(pipe_[0], &c, 1), 1);
  }
  void kill() {
    ::kill(child_, SIGKILL);
    int status = 0;
    ::waitpid(child_, &status, 0);
    EXPECT_TRUE(WIFSIGNALED(status));
  }

 private:
  [[noreturn]] void write(const std::filesystem::path& path, const SyntheticRun& run,
                          std::uint64_t max_frames) {
    ::close(pipe_[0]);
    const auto recorder = open_recorder(path, run.meta, run.spec);
    std::vector<float> values(24);
    for (std::uint64_t t = 0;; ++t) {
      if (t == max_frames) ::pause();
      for (std::size_t i = 0; i < values.size(); ++i)
        values[i] = static_cast<float>((t * 7919 + i * i) % 1000);
      const scene::ChannelData channel[] = {{"proximity", 4, 6, 1, values}};
      recorder->record_frame(run.snapshot_at(t, {0, 1, 2}), run.spec.objects, channel);
      if (::write(pipe_[1], "x", 1) != 1) std::abort();
    }
  }

  int pipe_[2] = {};
  pid_t child_ = -1;
};

void expect_readable(const std::filesystem::path& path, std::size_t min_frames) {
  const Recording recording = Recording::open(path);
  EXPECT_FALSE(recording.result());
  ASSERT_GE(recording.frames(), min_frames);
  const std::vector<float> p = recording.read_positions(0, recording.frames());
  for (std::size_t f = 0; f < recording.frames(); ++f) {
    ASSERT_EQ(recording.ticks()[f], f);
    ASSERT_EQ(recording.state_hashes()[f], 0x8000000000000000u + f);
    ASSERT_EQ(p[9 * f + 3], SyntheticRun::x(f, 1));
    ASSERT_EQ(recording.read_channel(ChannelGroup::kSensors, "proximity", f)[2],
              static_cast<float>((f * 7919 + 4) % 1000));
  }
}

TEST(KilledWriter, FileIsReadableUpToLastFlush) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.record.sensors = scene::SensorRecording::kAlways;
  KilledWriterProcess writer(out / "run.h5", run);
  writer.wait_for_frames(200);
  writer.kill();
  expect_readable(out / "run.h5", 192);  // three buffers of 64
}

TEST(KilledWriter, FileIsReadableWhileOpen) {
  const OutputFolder out;
  SyntheticRun run;
  KilledWriterProcess writer(out / "run.h5", run, 130);
  writer.wait_for_frames(130);
  EXPECT_GE(Recording::open(out / "run.h5").frames(), 128u);
  writer.kill();
}

// The scheduler determines the exact time of each kill, so that many repetitions also hit flushes.
TEST(KilledWriter, FileIsReadableWheneverKilled) {
  const OutputFolder out;
  SyntheticRun run;
  run.spec.record.sensors = scene::SensorRecording::kAlways;
  const char* more = std::getenv("RECORD_TEST_KILLS");
  const int kills = more ? std::atoi(more) : cases(25, 8);
  for (int i = 0; i < kills && !HasFatalFailure(); ++i) {
    const int frames = 64 + (i * 37) % 200;
    KilledWriterProcess writer(out / "run.h5", run);
    writer.wait_for_frames(frames);
    writer.kill();
    expect_readable(out / "run.h5", static_cast<std::size_t>(frames / 64 * 64));
  }
}

}  // namespace
}  // namespace smartsurf::record
