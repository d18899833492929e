// Device addresses, and detection of a lost line.
#include "shm-protocol/hardware/bridge/Port.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <random>
#include <stdexcept>
#include <vector>

#include "shm-protocol/hardware/fake/EmulatedLine.h"

namespace hardware {
namespace {

TEST(PortName, DistinguishesTerminalsFromServers) {
  EXPECT_FALSE(PortAddress::parse("/dev/ttyUSB0", 115200).tcp());
  const PortAddress tcp = PortAddress::parse("tcp:[::1]:5000", 115200);
  EXPECT_TRUE(tcp.tcp());
  EXPECT_EQ(tcp.host, "::1");
  EXPECT_EQ(tcp.service, "5000");
  EXPECT_EQ(PortAddress::parse("tcp:host.example:1", 9600).host, "host.example");
}

TEST(PortName, RejectsInvalidAddresses) {
  for (const char* text : {"", "tcp:", "tcp:host", "tcp::5000", "tcp:host:", "tcp:host:http"})
    EXPECT_THROW(PortAddress::parse(text, 115200), std::invalid_argument) << text;
  EXPECT_THROW(PortAddress::parse("/dev/ttyUSB0", 12345), std::invalid_argument);
}

TEST(Port, RejectsWhatIsNoLine) {
  for (const char* text : {"/proc/self/status", "/proc/self", "tcp:localhost:0", "tcp:localhost:65536"})
    EXPECT_THROW(PortAddress::parse(text, 115200), std::invalid_argument) << text;
  std::string why;
  EXPECT_FALSE(Port::open(PortAddress::parse("/dev/null", 115200), why));
  EXPECT_FALSE(why.empty());
  why.clear();
  EXPECT_FALSE(Port::open(PortAddress::parse("/dev/no-such-line", 115200), why));
  EXPECT_NE(why.find("No such file"), std::string::npos) << why;
}

// Reads until data arrives or the line is lost.
std::optional<std::size_t> read_some(Port& port, std::span<std::uint8_t> to) {
  for (;;) {
    const auto got = port.read(to);
    if (!got || *got != 0) return got;
    ::usleep(1000);
  }
}

void exchange_and_cut(EmulatedLine& line) {
  std::string why;
  auto port = Port::open(PortAddress::parse(line.name(), 115200), why);
  ASSERT_TRUE(port) << why;
  std::vector<std::uint8_t> all(256), got;
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::uint8_t>(i);
  ASSERT_EQ(port->write(all), all.size());
  while (got.size() < all.size()) line.read(got);
  EXPECT_EQ(got, all);  // raw: no terminal processing
  line.write(all);
  std::vector<std::uint8_t> back;
  while (back.size() < all.size()) {
    std::uint8_t bytes[300];
    const auto n = read_some(*port, bytes);
    ASSERT_TRUE(n);
    back.insert(back.end(), bytes, bytes + *n);
  }
  EXPECT_EQ(back, all);
  line.unplug();
  std::uint8_t byte;
  EXPECT_EQ(read_some(*port, {&byte, 1}), std::nullopt);
}

TEST(Port, TerminalTransfersAllBytesAndDetectsHangup) {
  const std::string link = ::testing::TempDir() + "port-test-" + std::to_string(::getpid());
  const auto line = std::unique_ptr<EmulatedLine>(new EmulatedLine(EmulatedLine::terminal(link)));
  exchange_and_cut(*line);
}

TEST(Port, TcpTransfersAllBytesAndDetectsHangup) {
  const auto line = std::unique_ptr<EmulatedLine>(new EmulatedLine(EmulatedLine::tcp(0)));
  exchange_and_cut(*line);
}

// Whatever the last program on the line left.
TEST(Port, TerminalIsRawAndWithoutFlowControl) {
  const std::string link = ::testing::TempDir() + "port-test-raw-" + std::to_string(::getpid());
  std::mt19937 random(1);
  for (int attempt = 0; attempt < 20; ++attempt) {
    const auto line = std::unique_ptr<EmulatedLine>(new EmulatedLine(EmulatedLine::terminal(link)));
    const int other = ::open(link.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
    termios settings{};
    ASSERT_EQ(::tcgetattr(other, &settings), 0);
    settings.c_iflag =
        random() & (IGNBRK | BRKINT | PARMRK | ISTRIP | INLCR | IGNCR | ICRNL | IXON | IXOFF | IXANY);
    settings.c_oflag ^= random() & OPOST;
    settings.c_cflag ^= random() & (CSTOPB | CRTSCTS | HUPCL | PARENB | CLOCAL);
    settings.c_lflag = random() & (ICANON | ECHO | ECHONL | ISIG | IEXTEN);
    ASSERT_EQ(::tcsetattr(other, TCSANOW, &settings), 0);
    std::string why;
    const auto port = Port::open(PortAddress::parse(link, 115200), why);
    ASSERT_TRUE(port) << why;
    ASSERT_EQ(::tcgetattr(port->descriptor(), &settings), 0);
    EXPECT_EQ(settings.c_iflag, 0u);
    EXPECT_EQ(settings.c_oflag & OPOST, 0u);
    EXPECT_EQ(settings.c_cflag & (CSIZE | PARENB | CSTOPB | CRTSCTS | HUPCL | CLOCAL | CREAD),
              static_cast<tcflag_t>(CS8 | CLOCAL | CREAD));
    EXPECT_EQ(settings.c_lflag, 0u);
    ::close(other);
  }
}

// Also by root, whom no terminal refuses. A refused program leaves the line as it is.
TEST(Port, TerminalIsOpenOnce) {
  const std::string link = ::testing::TempDir() + "port-test-once-" + std::to_string(::getpid());
  const auto line = std::unique_ptr<EmulatedLine>(new EmulatedLine(EmulatedLine::terminal(link)));
  std::mt19937 random(3);
  std::vector<std::uint8_t> sent, got;
  for (int session = 0; session < 20; ++session) {
    std::string why;
    auto port = Port::open(PortAddress::parse(link, 115200), why);
    ASSERT_TRUE(port) << why;
    sent.resize(1 + random() % 100);
    for (std::uint8_t& byte : sent) byte = static_cast<std::uint8_t>(random());
    line->write(sent);
    for (std::uint32_t others = random() % 3; others > 0; --others) {
      ASSERT_FALSE(Port::open(PortAddress::parse(link, 9600), why));
      EXPECT_EQ(why, "cannot open " + link + ": Device or resource busy");
    }
    termios settings{};
    ASSERT_EQ(::tcgetattr(port->descriptor(), &settings), 0);
    EXPECT_EQ(::cfgetispeed(&settings), static_cast<speed_t>(B115200));
    for (got.clear(); got.size() < sent.size();) {
      std::uint8_t bytes[100];
      const auto n = read_some(*port, bytes);
      ASSERT_TRUE(n);
      got.insert(got.end(), bytes, bytes + *n);
    }
    EXPECT_EQ(got, sent);
  }
}

// A host that vanishes from the network sends no FIN and no RST: the device holds its connection.
TEST(Port, DeviceGivesUpAConnectionThatItsNetworkHasCut) {
  const auto device = std::unique_ptr<EmulatedLine>(new EmulatedLine(EmulatedLine::tcp(0)));
  PortAddress address = PortAddress::parse(device->name(), 115200);
  std::vector<std::uint8_t> got;
  for (std::uint8_t connection = 1; connection < 5; ++connection) {
    std::string why;
    auto port = Port::open(address, why);
    ASSERT_TRUE(port) << why;
    address.local_port = port->local_port();
    int timeout_ms = 0;
    socklen_t size = sizeof timeout_ms;
    ::getsockopt(port->descriptor(), IPPROTO_TCP, TCP_USER_TIMEOUT, &timeout_ms, &size);
    EXPECT_EQ(timeout_ms, 2000);
    ASSERT_EQ(port->write({&connection, 1}), 1u);
    for (int attempt = 0; attempt < 2000 && got.size() < connection; ++attempt) {
      device->read(got);
      ::usleep(1000);
    }
    ASSERT_EQ(got.size(), connection);
    const int silently = 1;  // closes without a word
    if (::setsockopt(port->descriptor(), IPPROTO_TCP, TCP_REPAIR, &silently, sizeof silently) != 0)
      GTEST_SKIP() << "needs CAP_NET_ADMIN";
  }
}

// The port of before may be in use.
TEST(Port, TcpConnectsFromAnyPortIfItsOwnIsTaken) {
  const auto device = std::unique_ptr<EmulatedLine>(new EmulatedLine(EmulatedLine::tcp(0)));
  PortAddress address = PortAddress::parse(device->name(), 115200);
  std::string why;
  const auto first = Port::open(address, why);
  ASSERT_TRUE(first) << why;
  address.local_port = first->local_port();
  const auto second = Port::open(address, why);
  ASSERT_TRUE(second) << why;
  EXPECT_NE(second->local_port(), first->local_port());
}

}  // namespace
}  // namespace hardware
