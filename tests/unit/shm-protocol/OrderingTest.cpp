// Litmus tests for the memory ordering that the models assume: two threads race over many independent copies
// of the words.
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <thread>
#include <vector>

#include "shm-protocol/src/ring/ChunkedTransfer.h"
#include "shm-protocol/src/ring/Ring.h"
#include "shm-protocol/src/wait/Atomics.h"

namespace shm_protocol {
namespace {

// Runs both functions concurrently, each over all copies in order.
template <class A, class B>
void race(std::size_t copies, A&& a, B&& b) {
  std::atomic<int> ready{0};
  const auto start = [&] {
    ++ready;
    while (ready < 2) std::this_thread::yield();
  };
  std::thread other([&] {
    start();
    for (std::size_t i = 0; i < copies; ++i) b(i);
  });
  start();
  for (std::size_t i = 0; i < copies; ++i) a(i);
  other.join();
}

// Dekker's pattern, which prevents lost wake-ups: sleeper and publisher never both miss the other's store.
TEST(Ordering, FlagAndWordAreNeverBothMissed) {
  struct alignas(128) Copy {
    std::uint32_t word = 0;
    alignas(64) std::uint32_t flag = 0;
    std::uint32_t word_seen = 2, flag_seen = 2;
  };
  std::size_t both_missed = 0;
  for (int round = 0; round < 20; ++round) {
    std::vector<Copy> copies(5'000);
    race(
        copies.size(),
        [&](std::size_t i) {
          store_seq_cst(copies[i].word, 1);
          copies[i].flag_seen = load_seq_cst(copies[i].flag);
        },
        [&](std::size_t i) {
          store_seq_cst(copies[i].flag, 1);
          copies[i].word_seen = load_seq_cst(copies[i].word);
        });
    for (const Copy& c : copies) both_missed += c.word_seen == 0 && c.flag_seen == 0;
  }
  EXPECT_EQ(both_missed, 0u);
}

// Who sees the count of a chunk sees its bytes, and the same of a frame's announcement; ThreadSanitizer
// judges the order of these plain reads too.
TEST(Ordering, BytesAreVisibleBeforeTheCount) {
  constexpr std::size_t kCopies = 20'000;
  struct alignas(128) Copy {
    std::uint32_t data = 0;
    alignas(64) ssp_progress line{};
  };
  std::vector<Copy> copies(kCopies);
  std::size_t early = 0, seen = 0;
  race(
      kCopies,
      [&](std::size_t i) {
        copies[i].data = 1;
        store_seq_cst(copies[i].line.ready, encode_progress(7, 256));
      },
      [&](std::size_t i) {
        if (committed_bytes(copies[i].line, 7, 4096) == 0) return;
        ++seen;
        early += copies[i].data != 1;
      });
  EXPECT_EQ(early, 0u);
}

// On the publication line `answers` comes after `frame`: never the new answer with the old frame.
TEST(Ordering, FrameIsVisibleBeforeAnswers) {
  std::vector<ssp_publication> lines(20'000);
  std::size_t mixed = 0;
  race(
      lines.size(),
      [&](std::size_t i) {
        store_publication(lines[i], {9, 1, 0.0, 5, 0}, 0);
      },
      [&](std::size_t i) {
        mixed += load_acquire(lines[i].answers) == 5 && load_relaxed(lines[i].frame) != 9;
      });
  EXPECT_EQ(mixed, 0u);
}

// Only an explicit fence orders non-temporal stores.
TEST(Ordering, StreamedBytesArePublishedBeforeTheirCount) {
  constexpr std::size_t kBytes = 256 * 1024;
  struct Freed {
    void operator()(std::byte* memory) const { ::operator delete[](memory, std::align_val_t{128}); }
  };
  const std::unique_ptr<std::byte[], Freed> slot(
      static_cast<std::byte*>(::operator new[](kBytes + sizeof(ssp_slot), std::align_val_t{128})));
  ssp_progress line{};
  const std::uint32_t word = 0, waiting = 0;
  ssp_channel channel{};
  channel.offset = sizeof(ssp_slot), channel.bytes = kBytes;
  ChunkWriter writer(line, word, waiting, kBytes + 4096);
  std::uint32_t taken = 0;  // the frame that the reader has checked
  std::size_t wrong = 0;
  constexpr std::uint32_t kFrames = 60;
  std::thread reader([&] {
    std::vector<std::byte> copy(kBytes);
    for (std::uint32_t frame = 1; frame <= kFrames; ++frame) {
      for (std::size_t checked = sizeof(ssp_slot); checked < kBytes;) {
        const std::size_t end = committed_bytes(line, frame, sizeof(ssp_slot) + kBytes);
        if (end <= checked) std::this_thread::yield();
        if (end <= checked) continue;
        copy_frame(copy.data(), slot.get() + checked, end - checked);
        for (std::size_t i = 0; i < end - checked; ++i) wrong += copy[i] != static_cast<std::byte>(frame);
        checked = end;
      }
      store_release(taken, frame);
    }
  });
  for (std::uint32_t frame = 1; frame <= kFrames; ++frame) {
    const std::vector<std::byte> values(kBytes, static_cast<std::byte>(frame));
    writer.write(slot.get(), frame, channel, 0, values, true);
    while (load_acquire(taken) != frame) std::this_thread::yield();
    writer.on_answered();
  }
  reader.join();
  EXPECT_EQ(wrong, 0u);
}

}  // namespace
}  // namespace shm_protocol
