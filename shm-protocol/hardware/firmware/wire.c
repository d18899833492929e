#include "wire.h"

#include <string.h>

uint32_t ssw_crc32(const uint8_t* bytes, size_t count) {
  /* Nibble-wise: a table of 64 bytes instead of 1024, for small devices. */
  static const uint32_t table[16] = {
      0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u, 0x4DB26158u, 0x5005713Cu,
      0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu, 0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu};
  uint32_t crc = 0xFFFFFFFFu;
  size_t i;
  for (i = 0; i < count; ++i) {
    crc ^= bytes[i];
    crc = (crc >> 4) ^ table[crc & 15u];
    crc = (crc >> 4) ^ table[crc & 15u];
  }
  return ~crc;
}

size_t ssw_cobs_encode(const uint8_t* from, size_t count, uint8_t* to) {
  size_t code_at = 0, written = 1, i;
  uint8_t code = 1;
  for (i = 0; i < count; ++i) {
    if (from[i] != 0) {
      to[written++] = from[i];
      ++code;
    }
    if (from[i] == 0 || (code == 0xFF && i + 1 < count)) {
      to[code_at] = code;
      code_at = written++;
      code = 1;
    }
  }
  to[code_at] = code;
  return written;
}

size_t ssw_cobs_decode(const uint8_t* from, size_t count, uint8_t* to) {
  size_t read = 0, written = 0;
  while (read < count) {
    const size_t code = from[read++];
    if (code == 0 || read + code - 1 > count) return 0;
    memmove(to + written, from + read, code - 1);
    read += code - 1;
    written += code - 1;
    if (code != 0xFF && read < count) to[written++] = 0;
  }
  return written;
}

void ssw_put_u16(uint8_t* to, uint16_t value) {
  to[0] = (uint8_t)(value & 0xFFu);
  to[1] = (uint8_t)(value >> 8);
}

void ssw_put_u32(uint8_t* to, uint32_t value) {
  ssw_put_u16(to, (uint16_t)(value & 0xFFFFu));
  ssw_put_u16(to + 2, (uint16_t)(value >> 16));
}

void ssw_put_f32(uint8_t* to, float value) {
  uint32_t bits;
  memcpy(&bits, &value, sizeof bits);
  ssw_put_u32(to, bits);
}

uint16_t ssw_get_u16(const uint8_t* from) { return (uint16_t)(from[0] | ((unsigned)from[1] << 8)); }

uint32_t ssw_get_u32(const uint8_t* from) {
  return (uint32_t)ssw_get_u16(from) | ((uint32_t)ssw_get_u16(from + 2) << 16);
}

float ssw_get_f32(const uint8_t* from) {
  const uint32_t bits = ssw_get_u32(from);
  float value;
  memcpy(&value, &bits, sizeof value);
  return value;
}

size_t ssw_write(const ssw_packet* packet, uint8_t* to) {
  uint8_t raw[SSW_MAX_PACKET];
  size_t count = SSW_HEADER + packet->payload_bytes, encoded;
  if (packet->payload_bytes > SSW_MAX_PAYLOAD) return 0;
  raw[0] = packet->type;
  raw[1] = packet->sequence;
  ssw_put_u32(raw + 2, packet->tick);
  if (packet->payload_bytes != 0) memcpy(raw + SSW_HEADER, packet->payload, packet->payload_bytes);
  ssw_put_u32(raw + count, ssw_crc32(raw, count));
  count += SSW_CRC;
  to[0] = 0; /* terminates noise received while the line was idle */
  encoded = ssw_cobs_encode(raw, count, to + 1);
  to[1 + encoded] = 0;
  return encoded + 2;
}

void ssw_receiver_init(ssw_receiver* r) { memset(r, 0, sizeof *r); }

/* Handles the end of a run of bytes between two zeros. */
static int finish(ssw_receiver* r, ssw_packet* packet) {
  const size_t encoded = r->count;
  const int overlong = r->overlong;
  size_t count;
  r->count = 0;
  r->overlong = 0;
  if (encoded == 0 && !overlong) return 0; /* two zeros in a row */
  count = overlong ? 0 : ssw_cobs_decode(r->bytes, encoded, r->bytes);
  if (count < SSW_HEADER + SSW_CRC || count > SSW_MAX_PACKET ||
      ssw_get_u32(r->bytes + count - SSW_CRC) != ssw_crc32(r->bytes, count - SSW_CRC)) {
    ++r->damaged;
    return 0;
  }
  ++r->packets;
  packet->type = r->bytes[0];
  packet->sequence = r->bytes[1];
  packet->tick = ssw_get_u32(r->bytes + 2);
  packet->payload = r->bytes + SSW_HEADER;
  packet->payload_bytes = count - SSW_HEADER - SSW_CRC;
  return 1;
}

int ssw_receive(ssw_receiver* r, uint8_t byte, ssw_packet* packet) {
  if (byte == 0) return finish(r, packet);
  if (r->count == sizeof r->bytes)
    r->overlong = 1;
  else
    r->bytes[r->count++] = byte;
  return 0;
}

void ssw_put_hello(const ssw_hello* hello, uint8_t to[SSW_HELLO_BYTES]) {
  to[0] = hello->version;
  to[1] = hello->channels;
  ssw_put_u16(to + 2, hello->rows);
  ssw_put_u16(to + 4, hello->columns);
  ssw_put_u32(to + 6, hello->period_us);
  ssw_put_f32(to + 10, hello->pitch);
  ssw_put_u32(to + 14, hello->boot);
  memcpy(to + 18, hello->name, sizeof hello->name);
}

static void get_hello(const uint8_t* from, ssw_hello* hello) {
  hello->version = from[0];
  hello->channels = from[1];
  hello->rows = ssw_get_u16(from + 2);
  hello->columns = ssw_get_u16(from + 4);
  hello->period_us = ssw_get_u32(from + 6);
  hello->pitch = ssw_get_f32(from + 10);
  hello->boot = ssw_get_u32(from + 14);
  memcpy(hello->name, from + 18, sizeof hello->name);
}

int ssw_get_hello(const ssw_packet* packet, ssw_hello* hello) {
  if (packet->type != SSW_HELLO || packet->payload_bytes != SSW_HELLO_BYTES) return 0;
  get_hello(packet->payload, hello);
  return 1;
}

void ssw_put_hello2(const ssw_hello2* board, uint8_t to[SSW_HELLO2_BYTES]) {
  ssw_put_hello(&board->hello, to);
  memcpy(to + 34, board->id, sizeof board->id);
  ssw_put_u32(to + 50, board->abilities);
  ssw_put_u32(to + 54, board->program_hash);
  ssw_put_u16(to + 58, board->sense_delay_us);
  ssw_put_u16(to + 60, board->actuate_delay_us);
  to[62] = board->links;
  to[63] = 0;
  ssw_put_u16(to + 64, board->queue);
}

int ssw_get_hello2(const ssw_packet* packet, ssw_hello2* board) {
  const uint8_t* from = packet->payload;
  if (packet->type != SSW_HELLO2 || packet->payload_bytes != SSW_HELLO2_BYTES) return 0;
  get_hello(from, &board->hello);
  memcpy(board->id, from + 34, sizeof board->id);
  board->abilities = ssw_get_u32(from + 50);
  board->program_hash = ssw_get_u32(from + 54);
  board->sense_delay_us = ssw_get_u16(from + 58);
  board->actuate_delay_us = ssw_get_u16(from + 60);
  board->links = from[62];
  board->queue = ssw_get_u16(from + 64);
  return 1;
}

void ssw_put_channel(const ssw_channel* channel, uint8_t to[SSW_CHANNEL_BYTES]) {
  to[0] = channel->index;
  to[1] = channel->direction;
  to[2] = channel->dtype;
  to[3] = channel->components;
  ssw_put_f32(to + 4, channel->minimum);
  ssw_put_f32(to + 8, channel->maximum);
  ssw_put_f32(to + 12, channel->safe);
  ssw_put_f32(to + 16, channel->scale);
  ssw_put_f32(to + 20, channel->offset);
  memcpy(to + 24, channel->name, sizeof channel->name);
  memcpy(to + 56, channel->unit, sizeof channel->unit);
}

static void get_channel(const uint8_t* from, ssw_channel* channel) {
  channel->index = from[0];
  channel->direction = from[1];
  channel->dtype = from[2];
  channel->components = from[3];
  channel->minimum = ssw_get_f32(from + 4);
  channel->maximum = ssw_get_f32(from + 8);
  channel->safe = ssw_get_f32(from + 12);
  channel->scale = ssw_get_f32(from + 16);
  channel->offset = ssw_get_f32(from + 20);
  memcpy(channel->name, from + 24, sizeof channel->name);
  memcpy(channel->unit, from + 56, sizeof channel->unit);
}

int ssw_get_channel(const ssw_packet* packet, ssw_channel* channel) {
  if (packet->type != SSW_CHANNEL || packet->payload_bytes != SSW_CHANNEL_BYTES) return 0;
  get_channel(packet->payload, channel);
  return 1;
}

void ssw_put_channel2(const ssw_channel2* channel, uint8_t to[SSW_CHANNEL2_BYTES]) {
  ssw_put_channel(&channel->channel, to);
  ssw_put_f32(to + 72, channel->limits.slew);
  ssw_put_f32(to + 76, channel->limits.acceleration);
  ssw_put_f32(to + 80, channel->limits.soft_start);
  ssw_put_u16(to + 84, channel->limits.most_moving);
  ssw_put_u16(to + 86, channel->flags);
}

int ssw_get_channel2(const ssw_packet* packet, ssw_channel2* channel) {
  const uint8_t* from = packet->payload;
  if (packet->type != SSW_CHANNEL2 || packet->payload_bytes != SSW_CHANNEL2_BYTES) return 0;
  get_channel(from, &channel->channel);
  channel->limits.slew = ssw_get_f32(from + 72);
  channel->limits.acceleration = ssw_get_f32(from + 76);
  channel->limits.soft_start = ssw_get_f32(from + 80);
  channel->limits.most_moving = ssw_get_u16(from + 84);
  channel->flags = ssw_get_u16(from + 86);
  return 1;
}

void ssw_put_sync(const ssw_sync* sync, uint8_t to[SSW_SYNC_BYTES]) {
  ssw_put_u32(to, sync->t1);
  ssw_put_u32(to + 4, sync->table_tick);
  ssw_put_u32(to + 8, (uint32_t)sync->correction_us);
  ssw_put_u32(to + 12, (uint32_t)sync->rate_ppb);
}

int ssw_get_sync(const ssw_packet* packet, ssw_sync* sync) {
  const uint8_t* from = packet->payload;
  if (packet->type != SSW_SYNC || packet->payload_bytes != SSW_SYNC_BYTES) return 0;
  sync->t1 = ssw_get_u32(from);
  sync->table_tick = ssw_get_u32(from + 4);
  sync->correction_us = (int32_t)ssw_get_u32(from + 8);
  sync->rate_ppb = (int32_t)ssw_get_u32(from + 12);
  return 1;
}

/* SSW_CLOCK and SSW_STATUS are five u32 each. */
static void put_five(const uint32_t* words, uint8_t* to) {
  unsigned i;
  for (i = 0; i < 5; ++i) ssw_put_u32(to + 4 * i, words[i]);
}

void ssw_put_clock(const ssw_clock* clock, uint8_t to[SSW_CLOCK_BYTES]) {
  const uint32_t words[5] = {clock->t1, clock->received, clock->sent, clock->tick, clock->into_us};
  put_five(words, to);
}

int ssw_get_clock(const ssw_packet* packet, ssw_clock* clock) {
  const uint8_t* from = packet->payload;
  if (packet->type != SSW_CLOCK || packet->payload_bytes != SSW_CLOCK_BYTES) return 0;
  clock->t1 = ssw_get_u32(from);
  clock->received = ssw_get_u32(from + 4);
  clock->sent = ssw_get_u32(from + 8);
  clock->tick = ssw_get_u32(from + 12);
  clock->into_us = ssw_get_u32(from + 16);
  return 1;
}

void ssw_put_status(const ssw_status* status, uint8_t to[SSW_STATUS_BYTES]) {
  const uint32_t words[5] = {status->flags, status->stop_reason, status->dropped, status->clamped,
                             status->limited};
  put_five(words, to);
}

int ssw_get_status(const ssw_packet* packet, ssw_status* status) {
  const uint8_t* from = packet->payload;
  if (packet->type != SSW_STATUS || packet->payload_bytes != SSW_STATUS_BYTES) return 0;
  status->flags = ssw_get_u32(from);
  status->stop_reason = ssw_get_u32(from + 4);
  status->dropped = ssw_get_u32(from + 8);
  status->clamped = ssw_get_u32(from + 12);
  status->limited = ssw_get_u32(from + 16);
  return 1;
}

size_t ssw_dtype_bytes(uint8_t dtype) {
  switch (dtype) {
    case SSW_F32:
      return 4;
    case SSW_U16:
      return 2;
    case SSW_U8:
      return 1;
    default:
      return 0;
  }
}

float ssw_most_raw(uint8_t dtype) { return dtype == SSW_U16 ? 65535.0f : 255.0f; }

/* The value, the offset, their difference and its quotient are each off by up to 2^-24 of themselves. */
float ssw_raw_error(const ssw_channel* c, float value) {
  const float v = value < 0.0f ? -value : value, o = c->offset < 0.0f ? -c->offset : c->offset;
  return 2.4e-7f * (v / c->scale + o / c->scale);
}

ssw_raw_range ssw_get_raw_range(const ssw_channel* c) {
  const float most = ssw_most_raw(c->dtype);
  const float low = (c->minimum - c->offset) / c->scale - ssw_raw_error(c, c->minimum);
  const float high = (c->maximum - c->offset) / c->scale + ssw_raw_error(c, c->maximum);
  ssw_raw_range range = {0.0f, -1.0f};
  if (low > most) {
    range.lowest = most + 1.0f;
  } else if (low > 0.0f) {
    range.lowest = (float)(uint32_t)low;
    if (range.lowest < low) range.lowest += 1.0f;
  }
  if (high >= most)
    range.highest = most;
  else if (high >= 0.0f)
    range.highest = (float)(uint32_t)high;
  return range;
}
