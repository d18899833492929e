// iceoryx: untyped publishers and subscribers with waiting receivers. Starts its daemon, iox-roudi.
#include "RoundTrip.h"

#ifdef BENCH_ICEORYX
#include <iceoryx_hoofs/log/logmanager.hpp>
#include <iceoryx_posh/popo/untyped_publisher.hpp>
#include <iceoryx_posh/popo/untyped_subscriber.hpp>
#include <iceoryx_posh/popo/wait_set.hpp>
#include <iceoryx_posh/runtime/posh_runtime.hpp>

#include <fcntl.h>
#include <cstdlib>
#include <fstream>
#include <string>

namespace bench {
namespace {

// Runs the daemon, with memory pools for chunks of up to 4 MiB. The destructor terminates it.
class Daemon {
 public:
  Daemon() {
    const std::string file = "/tmp/smartsurf-bench-roudi-" + std::to_string(::getpid()) + ".toml";
    std::ofstream(file)
        << "[general]\nversion = 1\n[[segment]]\n[[segment.mempool]]\nsize = 128\ncount = 64\n"
           "[[segment.mempool]]\nsize = 16640\ncount = 64\n"
           "[[segment.mempool]]\nsize = 4194560\ncount = 32\n";
    pid_ = ::fork();
    if (pid_ == 0) {
      ::prctl(PR_SET_PDEATHSIG, SIGKILL);
      const int nowhere = ::open("/dev/null", O_WRONLY);
      ::dup2(nowhere, 1);
      ::dup2(nowhere, 2);
      ::execlp("iox-roudi", "iox-roudi", "-c", file.c_str(), "-l", "fatal", static_cast<char*>(nullptr));
      ::_exit(127);
    }
    ::sleep(2);
    ::unlink(file.c_str());
  }
  ~Daemon() {
    ::kill(pid_, SIGTERM);
    // The daemon waits for its clients, but a killed client never disconnects.
    for (int i = 0; i < 30; ++i) {
      if (::waitpid(pid_, nullptr, WNOHANG) != 0) return;
      ::usleep(100'000);
    }
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }

 private:
  pid_t pid_;
};

const iox::capro::IdString_t kService{"Bench"}, kForth{"Forth"}, kHome{"Home"};
using Text = iox::capro::IdString_t;

// One endpoint: publishes on one event name and receives from the other.
class End {
 public:
  End(const Text& instance, const Text& sends, const Text& takes, std::size_t bytes)
      : publisher_({kService, instance, sends}),
        subscriber_({kService, instance, takes}, options()),
        bytes_(bytes) {
    waiting_.attachState(subscriber_, iox::popo::SubscriberState::HAS_DATA).or_else([](auto) {
      std::_Exit(1);
    });
  }
  bool connected() const {
    return publisher_.hasSubscribers() &&
           subscriber_.getSubscriptionState() == iox::SubscribeState::SUBSCRIBED;
  }
  void send(int round) {
    publisher_.loan(static_cast<std::uint32_t>(bytes_))
        .and_then([&](void* chunk) {
          produce({static_cast<float*>(chunk), bytes_ / sizeof(float)}, round);
          publisher_.publish(chunk);
        })
        .or_else([](auto) { std::_Exit(1); });
  }
  void take() {
    for (bool taken = false; !taken;) {
      (void)waiting_.wait();
      subscriber_.take().and_then([&](const void* chunk) {
        consume({static_cast<const float*>(chunk), bytes_ / sizeof(float)});
        subscriber_.release(chunk);
        taken = true;
      });
    }
  }

 private:
  static iox::popo::SubscriberOptions options() {
    iox::popo::SubscriberOptions o;
    o.queueCapacity = 4;
    return o;
  }
  iox::popo::UntypedPublisher publisher_;
  iox::popo::UntypedSubscriber subscriber_;
  iox::popo::WaitSet<1> waiting_;
  std::size_t bytes_;
};

// Uses a unique name per client, because the daemon remembers killed clients for a while.
void join_as(const std::string& who) {
  iox::log::LogManager::GetLogManager().SetDefaultLogLevel(iox::log::LogLevel::kOff,
                                                           iox::log::LogLevelOutput::kHideLogLevel);
  iox::runtime::PoshRuntime::initRuntime(
      iox::RuntimeName_t(iox::cxx::TruncateToCapacity, who + std::to_string(::getpid())));
}

Figures run(const Case& c, int peer_cpu) {
  const std::size_t bytes = std::size_t{c.side} * c.side * sizeof(float);
  const Text instance(iox::cxx::TruncateToCapacity,
                      std::to_string(::getpid()) + "-" + std::to_string(c.side));
  const pid_t peer = start_peer(peer_cpu, [&] {
    join_as("bench-peer-");
    End end(instance, kHome, kForth, bytes);
    for (int i = 1;; ++i) {
      end.take();
      end.send(i);
    }
  });
  join_as("bench-first-");
  End end(instance, kForth, kHome, bytes);
  while (!end.connected()) ::usleep(1000);
  const Figures figures = measure(c.rounds, [&](int i) {
    end.send(i);
    end.take();
  });
  ::kill(peer, SIGKILL);
  ::waitpid(peer, nullptr, 0);
  return figures;
}

}  // namespace

const char* iceoryx_unavailable() { return nullptr; }

// Runs in a separate process: there is one runtime per process, and its threads do not survive fork().
Figures iceoryx(const Case& c, int peer_cpu) {
  static const Daemon daemon;
  int result[2];
  if (::pipe(result) != 0) std::abort();
  const pid_t child = ::fork();
  if (child == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    ::alarm(10);  // its start sometimes hangs
    const Figures figures = run(c, peer_cpu);
    ::_exit(::write(result[1], &figures, sizeof figures) == sizeof figures ? 0 : 1);
  }
  ::close(result[1]);
  Figures figures;
  if (::read(result[0], &figures, sizeof figures) != sizeof figures)
    std::fprintf(stderr, "bench_lockstep: iceoryx failed in the case %s\n", c.label);
  ::close(result[0]);
  ::waitpid(child, nullptr, 0);
  return figures;
}

}  // namespace bench
#else
namespace bench {
const char* iceoryx_unavailable() { return "libiceoryx-posh-dev or iceoryx (iox-roudi) is not installed"; }
Figures iceoryx(const Case&, int) { return {}; }
}  // namespace bench
#endif
