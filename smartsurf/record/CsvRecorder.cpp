#include "smartsurf/record/CsvRecorder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <system_error>
#include <utility>

#include "common/csv/Csv.h"
#include "common/text/Number.h"

namespace smartsurf::record {
namespace {

constexpr std::size_t kBufferBytes = 256 * 1024;

}  // namespace

CsvRecorder::CsvRecorder(const std::filesystem::path& path, std::unique_ptr<PendingFile> pending,
                         const scene::SceneSpec& spec)
    : Recorder(spec.record.tick_interval),
      name_(path.string()),
      pending_(std::move(pending)),
      fd_(::open(pending_->path().c_str(),
                 O_WRONLY | O_CREAT | O_CLOEXEC | (pending_->must_be_new() ? O_EXCL : O_TRUNC), 0666)),
      last_flush_(std::chrono::steady_clock::now()) {
  if (fd_ < 0) throw scene::InputError(name_ + ": cannot be written: " + std::strerror(errno));
  owned_fd_.emplace(fd_);
  ::flock(fd_, LOCK_EX | LOCK_NB);
  lines_.reserve(2 * kBufferBytes);
  lines_ = "tick,time,id,label,x,y,z,qx,qy,qz,qw\n";
  flush_lines();
}

int CsvRecorder::close_file() noexcept {
  owned_fd_.reset();
  return ::close(std::exchange(fd_, -1));
}

void CsvRecorder::require_unchanged() {
  try {
    pending_->require_unchanged();
  } catch (const std::runtime_error&) {
    close_file();
    throw;
  }
}

template <class Action>
void CsvRecorder::commit(Action action) {
  try {
    action(*pending_);
  } catch (const std::system_error& error) {
    if (fd_ >= 0) close_file();
    throw std::runtime_error(name_ + ": cannot be written: " + error.code().message());
  }
}

CsvRecorder::~CsvRecorder() {
  try {
    close({});
  } catch (const std::exception&) {  // a destructor cannot report errors
  }
  if (fd_ >= 0) close_file();  // of a child
}

void CsvRecorder::close(const RunResult&) {
  if (!is_writing()) return;
  flush_lines();
  require_unchanged();
  if (close_file() != 0) throw std::runtime_error(name_ + ": cannot be written: " + std::strerror(errno));
  commit([](PendingFile& pending) { pending.commit_if_new(); });
}

void CsvRecorder::write_frame(const scene::Snapshot& snapshot,
                              const std::vector<scene::ObjectSpec>& catalogue,
                              std::span<const scene::ChannelData>, std::span<const scene::ChannelData>,
                              std::span<const NamedNumber>) {
  if (!is_writing()) return;
  has_frames_ = true;
  for (std::size_t i = 0; i < snapshot.object_count(); ++i) {
    common::append_shortest(lines_, snapshot.tick);
    lines_ += ',';
    common::append_shortest(lines_, snapshot.time_s);
    lines_ += ',';
    common::append_shortest(lines_, snapshot.id[i]);
    lines_ += ',';
    common::append_csv_field(lines_, catalogue.at(snapshot.id[i]).label);
    for (const float v : snapshot.position[i]) common::append_shortest(lines_ += ',', v);
    for (const float v : snapshot.orientation[i]) common::append_shortest(lines_ += ',', v);
    lines_ += '\n';
  }
  if (lines_.size() >= kBufferBytes || std::chrono::steady_clock::now() - last_flush_ >= kMaxFlushInterval)
    flush_lines();
}

void CsvRecorder::flush_lines() {
  require_unchanged();
  for (std::size_t written = 0; written < lines_.size();) {
    const ssize_t n = ::write(fd_, lines_.data() + written, lines_.size() - written);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      const std::string reason = std::strerror(errno);
      close_file();
      throw std::runtime_error(name_ + ": cannot be written: " + reason);
    }
    written += n;
  }
  lines_.clear();
  pending_->note_length(::lseek(fd_, 0, SEEK_CUR));
  last_flush_ = std::chrono::steady_clock::now();
  if (has_frames_) commit([](PendingFile& pending) { pending.commit(); });
}

}  // namespace smartsurf::record
