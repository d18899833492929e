/* One board as a process: the generated program, its cells' frames on one socket, and a socket to each
 * neighbour.
 *
 * usage: board ROW COLUMN ROWS COLUMNS WORLD WEST EAST NORTH SOUTH [SEED LOSS DELAY REPEAT]
 *
 * ROW and COLUMN are the tile's north-west cell. WORLD is a descriptor of a stream that brings the clock and
 * the sensor frames and takes the actuator frames and the numbers of lost edges, tick by tick; the
 * neighbours' are of sockets that keep messages apart, -1 for none. LOSS, DELAY and REPEAT are the fractions
 * of edges that a link loses, brings a tick late, or brings twice. Both ends draw them from the same seed, so
 * that runs repeat. An edge that does not come within PATIENCE_MS is given up, and so is its side for the
 * rest of the tick. boards.h, which scripts/boards/boards writes, names the program. */
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "boards.h"

enum { PATIENCE_MS = 20000, HEADER_BYTES = 6, CELLS = TILE_ROWS * TILE_COLUMNS };

struct board {
  int world, links[4];
  int row, column;
  unsigned long long seed;
  double loss, delay, repeat;
  unsigned char late[4][HEADER_BYTES + TILE_MAX_EDGE_BYTES];
  size_t late_bytes[4];
  unsigned char buffer[4][HEADER_BYTES + TILE_MAX_EDGE_BYTES];
  size_t waiting[4]; /* bytes of a message that came before its turn */
  unsigned tick;
  unsigned char silent, missing, blocked; /* sides */
  unsigned long dropped;
};

static void fail(const char* what) {
  fprintf(stderr, "board: %s: %s\n", what, strerror(errno));
  exit(1);
}

static void read_whole(int from, void* bytes, size_t count) {
  unsigned char* to = bytes;
  while (count > 0) {
    const ssize_t got = read(from, to, count);
    if (got == 0) exit(0); /* the world has ended */
    if (got < 0 && errno != EINTR) fail("world");
    if (got > 0) {
      to += got;
      count -= (size_t)got;
    }
  }
}

static void write_whole(int to, const void* bytes, size_t count) {
  const unsigned char* from = bytes;
  while (count > 0) {
    const ssize_t put = write(to, from, count);
    if (put < 0 && errno == EPIPE) exit(0);
    if (put < 0 && errno != EINTR) fail("world");
    if (put > 0) {
      from += put;
      count -= (size_t)put;
    }
  }
}

/* What becomes of an edge: a number from 0 to 1 that its sender and its receiver draw alike (SplitMix64),
 * from the border that it crosses, its direction, tick and round. */
static double fate(const struct board* b, int side, int sends, unsigned round) {
  const int column = b->column + (side == TILE_EAST ? TILE_COLUMNS : 0),
            row = b->row + (side == TILE_SOUTH ? TILE_ROWS : 0);
  const int direction = sends ? side : side ^ 1; /* opposite sides are 0 and 1, 2 and 3 */
  unsigned long long x = b->seed * 0x9E3779B97F4A7C15ULL + (unsigned)row * 1000003ULL +
                         (unsigned)column * 10007ULL + (unsigned)direction * 101ULL +
                         b->tick * 0x100000001B3ULL + round * 0x1000193ULL;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  x ^= x >> 31;
  return (double)(x >> 11) / 9007199254740992.0;
}

static void begin(void* context, TILE_STATE* state, uint32_t tick) {
  struct board* b = context;
  double clock[3];
  b->tick = tick;
  b->silent = 0;
  read_whole(b->world, clock, sizeof clock);
#define READ(member) read_whole(b->world, state->member, CELLS * sizeof(float));
  SENSORS(READ)
  SET_CLOCK(state, clock)
}

static void end(void* context, TILE_STATE* state, uint32_t tick) {
  struct board* b = context;
  unsigned char written;
  (void)tick;
#define WRITE(member, flag)           \
  written = state->flag;              \
  write_whole(b->world, &written, 1); \
  write_whole(b->world, state->member, CELLS * sizeof(float));
  ACTUATORS(WRITE)
}

static int put(struct board* b, int side, const unsigned char* message, size_t count) {
  if (send(b->links[side], message, count, MSG_DONTWAIT | MSG_NOSIGNAL) >= 0) return TILE_READY;
  if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR || errno == ENOBUFS) {
    b->blocked = 1;
    return TILE_NOT_YET;
  }
  return TILE_GIVEN_UP; /* the neighbour is gone */
}

static int send_edge(void* context, int side, uint16_t round, const uint8_t* bytes, uint16_t count) {
  struct board* b = context;
  unsigned char message[HEADER_BYTES + TILE_MAX_EDGE_BYTES];
  const double what = fate(b, side, 1, round);
  int status;
  message[0] = (unsigned char)b->tick;
  message[1] = (unsigned char)(b->tick >> 8);
  message[2] = (unsigned char)(b->tick >> 16);
  message[3] = (unsigned char)(b->tick >> 24);
  message[4] = (unsigned char)round;
  message[5] = (unsigned char)(round >> 8);
  memcpy(message + HEADER_BYTES, bytes, count);
  if (b->late_bytes[side] > 0) { /* of an earlier round or tick: it comes before this one, and too late */
    if (put(b, side, b->late[side], b->late_bytes[side]) == TILE_NOT_YET) return TILE_NOT_YET;
    b->late_bytes[side] = 0;
  }
  if (what < b->loss) return TILE_READY;
  if (what < b->loss + b->delay) {
    memcpy(b->late[side], message, HEADER_BYTES + (size_t)count);
    b->late_bytes[side] = HEADER_BYTES + (size_t)count;
    return TILE_READY;
  }
  status = put(b, side, message, HEADER_BYTES + (size_t)count);
  if (status == TILE_READY && what < b->loss + b->delay + b->repeat)
    (void)put(b, side, message, HEADER_BYTES + (size_t)count);
  return status;
}

static int receive_edge(void* context, int side, uint16_t round, uint8_t* edge, uint16_t count) {
  struct board* b = context;
  const double what = fate(b, side, 0, round);
  if (what < b->loss + b->delay) return TILE_GIVEN_UP; /* this link's timeout, without the wait */
  if ((b->silent >> side) & 1) return TILE_GIVEN_UP;
  for (;;) {
    const unsigned char* message = b->buffer[side];
    unsigned tick, of;
    if (b->waiting[side] == 0) {
      const ssize_t got = recv(b->links[side], b->buffer[side], sizeof b->buffer[side], MSG_DONTWAIT);
      if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) {
        b->missing |= (unsigned char)(1 << side);
        return TILE_NOT_YET;
      }
      if (got < 0) return TILE_GIVEN_UP;
      if (got == 0) return TILE_GIVEN_UP;
      b->waiting[side] = (size_t)got;
    }
    tick = (unsigned)message[0] | (unsigned)message[1] << 8 | (unsigned)message[2] << 16 |
           (unsigned)message[3] << 24;
    of = (unsigned)message[4] | (unsigned)message[5] << 8;
    if (tick > b->tick || (tick == b->tick && of > round))
      return TILE_GIVEN_UP; /* the one before it was lost */
    if (tick == b->tick && of == round && b->waiting[side] == HEADER_BYTES + (size_t)count) {
      memcpy(edge, message + HEADER_BYTES, count);
      b->waiting[side] = 0;
      return TILE_READY;
    }
    b->waiting[side] = 0; /* old or repeated */
    ++b->dropped;
  }
}

static TILE_STATE state;
static struct board board;

int main(int count, char** arguments) {
  const TILE_LINKS links = {&board, begin, send_edge, receive_edge, end};
  int i, status;
  if (count != 10 && count != 14) {
    fprintf(stderr,
            "usage: board ROW COLUMN ROWS COLUMNS WORLD WEST EAST NORTH SOUTH [SEED LOSS DELAY REPEAT]\n");
    return 2;
  }
  board.world = atoi(arguments[5]);
  for (i = 0; i < 4; ++i) board.links[i] = atoi(arguments[6 + i]);
  if (count == 14) {
    board.seed = strtoull(arguments[10], NULL, 10);
    board.loss = atof(arguments[11]);
    board.delay = atof(arguments[12]);
    board.repeat = atof(arguments[13]);
  }
  if (TILE_INIT(&state, &links, atoi(arguments[1]), atoi(arguments[2]), atoi(arguments[3]),
                atoi(arguments[4])) != TILE_OK) {
    fprintf(stderr, "board: there is no such tile, or the compiler fuses operations\n");
    return 1;
  }
  board.row = atoi(arguments[1]);
  board.column = atoi(arguments[2]);
  for (;;) {
    struct pollfd ready[4];
    int open = 0;
    board.missing = board.blocked = 0;
    status = TILE_RUN(&state);
    if (status == TILE_ENDED) return 0;
    if (status == TILE_FAILED) {
      fprintf(stderr, "%s\n", TILE_ERROR(&state));
      return 1;
    }
    if (status == TILE_DONE) {
      const uint32_t numbers[5] = {state.lost[0], state.lost[1], state.lost[2], state.lost[3],
                                   (uint32_t)board.dropped};
      write_whole(board.world, numbers, sizeof numbers);
      continue;
    }
    for (i = 0; i < 4; ++i)
      if ((board.missing >> i) & 1) {
        ready[open].fd = board.links[i];
        ready[open++].events = POLLIN;
      }
    /* A full queue empties within a millisecond. */
    if (poll(ready, (nfds_t)open, board.blocked ? 1 : PATIENCE_MS) == 0 && !board.blocked)
      board.silent |= board.missing;
  }
}
