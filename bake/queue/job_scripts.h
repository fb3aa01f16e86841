// The state of a job in Redis, and the scripts that change it. Redis runs a script as a whole, so that a killed worker
// never leaves half of a change.
//
//   terrace:{JOB}:job     hash: what is baked (fields of JobIdentity), incarnation, state, lease_ms, units
//   terrace:{JOB}:units   stream with the consumer group "bakers": the units that are not done, field "unit"
//   terrace:{JOB}:dead    stream: the units that were given up: unit, why, deliveries, worker
//   terrace:{JOB}:taken   hash: unit -> "id worker milliseconds", by Redis's clock; for people
//   terrace:{JOB}:done    stream: the last units that were done: unit, worker, seconds; for people
//   terrace:{JOB}:errors  hash: unit -> "worker why" of its last failure
//   terrace:{JOB}:workers hash: worker -> milliseconds, by Redis's clock, when it was heard of last
//
// The keys that are for people, the errors and the workers are accessed by pcall, because they may hold a value of
// another type. A unit that is done is acknowledged and deleted from the stream. The braces keep the keys on one node
// of a cluster. The incarnation is a random number that is made whenever the queue is filled. A worker that took its
// unit from an earlier filling must not acknowledge it in a later one.
#pragma once

namespace terrace::bake::scripts {

// The last unit: writing the manifest.
inline constexpr const char* kFinishUnit = "*finish";
// The consumer that holds units until they are handed out again.
inline constexpr const char* kNobody = "-";

// Before each of the others. KEYS: as above. ARGV[1]: the incarnation; empty: there is no job. Redis 6.2 needs
// replicate_commands for scripts that ask the time and then write.
inline constexpr const char* kPrelude = R"lua(
local job, units, dead, taken, done, errors, workers = unpack(KEYS)
if redis.replicate_commands then redis.replicate_commands() end
if (redis.call('HGET', job, 'incarnation') or '') ~= ARGV[1] then return {'gone'} end
local function note_worker(worker)
  local time = redis.call('TIME')
  local now = time[1] .. string.format('%03d', math.floor(time[2] / 1000))
  redis.pcall('HSET', workers, worker, now)
  return now
end
local function remove(id, name)
  local noted = redis.pcall('HGET', taken, name)
  if type(noted) == 'string' and string.sub(noted, 1, #id + 1) == id .. ' ' then redis.call('HDEL', taken, name) end
  local acked = redis.call('XACK', units, 'bakers', id)
  redis.call('XDEL', units, id)
  return acked == 1
end
)lua";

// ARGV: incarnation, number of fields, fields and values, units. A Redis that is full refuses only the first write of a
// script, and never DEL.
inline constexpr const char* kFill = R"lua(
redis.call('HSET', job, 'state', 'filling')
redis.call('DEL', unpack(KEYS))
local fields = tonumber(ARGV[2])
for i = 1, fields do redis.call('HSET', job, ARGV[1 + 2 * i], ARGV[2 + 2 * i]) end
redis.call('XGROUP', 'CREATE', units, 'bakers', '0', 'MKSTREAM')
for i = 3 + 2 * fields, #ARGV do redis.call('XADD', units, '*', 'unit', ARGV[i]) end
return {'ok'}
)lua";

// ARGV: incarnation, units. If the job ended incomplete, hands out again the units that were given up.
inline constexpr const char* kRevive = R"lua(
if redis.call('XLEN', units) > 0 or redis.call('XLEN', dead) == 0 then return {'ok'} end
for i = 2, #ARGV do redis.call('XADD', units, '*', 'unit', ARGV[i]) end
redis.call('DEL', dead, errors)
return {'ok'}
)lua";

// ARGV: incarnation, worker, lease in ms. Hands out new units first, then units whose worker was silent for a lease,
// last the finishing unit. Idle times are Redis's, so that the clocks of the workers do not matter. The worker with
// which a unit failed last does not get it again while others are heard of: a unit is given up because of itself, not
// because of one worker without room or sources.
inline constexpr const char* kTake = R"lua(
local worker, lease = ARGV[2], ARGV[3]
local now = note_worker(worker)
local function hand_out(message, deliveries)
  local name = ''
  for i = 1, #message[2], 2 do
    if message[2][i] == 'unit' then name = message[2][i + 1] end
  end
  redis.pcall('HSET', taken, name, message[1] .. ' ' .. worker .. ' ' .. now)
  return {'unit', message[1], name, deliveries}
end
local function new()
  local streams = redis.call('XREADGROUP', 'GROUP', 'bakers', worker, 'COUNT', 1, 'STREAMS', units, '>')
  return streams and streams[1][2][1]
end
local others
local function has_others()
  if others ~= nil then return others end
  others = false
  local heard = redis.pcall('HGETALL', workers)
  for i = 1, #heard, 2 do
    if heard[i] ~= worker and tonumber(now) - (tonumber(heard[i + 1]) or 0) < tonumber(lease) then others = true end
  end
  return others
end
local function failed_here(message)
  local noted = redis.pcall('HGET', errors, message[2][2])
  return type(noted) == 'string' and string.sub(noted, 1, #worker + 1) == worker .. ' '
end
local message = new()
if message then return hand_out(message, 1) end
local from = '0-0'
repeat
  local claimed = redis.call('XAUTOCLAIM', units, 'bakers', worker, lease, from, 'COUNT', 1)
  from = claimed[1]
  message = claimed[2][1]
  if message then
    local deliveries = redis.call('XPENDING', units, 'bakers', message[1], message[1], 1)[1][4]
    if not (failed_here(message) and has_others()) then return hand_out(message, deliveries) end
    redis.call('XCLAIM', units, 'bakers', '-', 0, message[1], 'IDLE', lease, 'RETRYCOUNT', deliveries - 1, 'JUSTID')
  end
until from == '0-0'
if redis.call('XLEN', units) > 0 then return {'wait'} end
if redis.call('XLEN', dead) > 0 then return {'incomplete'} end
if redis.call('HGET', job, 'state') == 'finished' then return {'finished'} end
redis.call('XADD', units, '*', 'unit', '*finish')
return hand_out(new(), 1)
)lua";

// ARGV: incarnation, worker, ids. Renews the leases of those ids that this worker still holds.
inline constexpr const char* kBeat = R"lua(
note_worker(ARGV[2])
for i = 3, #ARGV do
  local pending = redis.call('XPENDING', units, 'bakers', ARGV[i], ARGV[i], 1)[1]
  if pending and pending[2] == ARGV[2] then
    redis.call('XCLAIM', units, 'bakers', ARGV[2], 0, ARGV[i], 'JUSTID')
  end
end
return {'ok'}
)lua";

// ARGV: incarnation, id, unit, worker, seconds. The unit may have been given up meanwhile, because its worker was
// silent. Its file exists now, so it is removed from the dead units.
inline constexpr const char* kDone = R"lua(
local is_new = remove(ARGV[2], ARGV[3])
for _, entry in ipairs(redis.call('XRANGE', dead, '-', '+')) do
  for i = 1, #entry[2], 2 do
    if entry[2][i] == 'unit' and entry[2][i + 1] == ARGV[3] then
      redis.call('XDEL', dead, entry[1])
      is_new = true
    end
  end
end
if is_new then
  redis.pcall('HDEL', errors, ARGV[3])
  redis.pcall('XADD', done, 'MAXLEN', '~', 1000, '*', 'unit', ARGV[3], 'worker', ARGV[4], 'seconds', ARGV[5])
end
return {'ok'}
)lua";

// ARGV: incarnation, id, unit, worker, why (empty: stopped), number of deliveries to count, initial idle time in ms.
inline constexpr const char* kGiveBack = R"lua(
local pending = redis.call('XPENDING', units, 'bakers', ARGV[2], ARGV[2], 1)[1]
if not pending or pending[2] ~= ARGV[4] then return {'ok'} end
if ARGV[5] ~= '' then redis.pcall('HSET', errors, ARGV[3], ARGV[4] .. ' ' .. ARGV[5]) end
redis.pcall('HDEL', taken, ARGV[3])
redis.call('XCLAIM', units, 'bakers', '-', 0, ARGV[2], 'IDLE', ARGV[7], 'RETRYCOUNT', ARGV[6], 'JUSTID')
return {'ok'}
)lua";

// ARGV: incarnation, id, unit, worker, why (empty: the last error that was noted), deliveries.
inline constexpr const char* kBury = R"lua(
local why = ARGV[5]
if why == '' then
  why = redis.pcall('HGET', errors, ARGV[3])
  why = type(why) == 'string' and string.match(why, '^%S+ (.*)$')
  if not why then why = 'its workers ended before it was done: killed, out of memory, or cut off' end
end
if remove(ARGV[2], ARGV[3]) then
  redis.call('XADD', dead, '*', 'unit', ARGV[3], 'why', why, 'deliveries', ARGV[6], 'worker', ARGV[4])
end
redis.pcall('HDEL', errors, ARGV[3])
return {'ok'}
)lua";

// ARGV: incarnation, id of the finishing unit, units whose files are missing.
inline constexpr const char* kAddMissing = R"lua(
for i = 3, #ARGV do redis.call('XADD', units, '*', 'unit', ARGV[i]) end
remove(ARGV[2], '*finish')
return {'ok'}
)lua";

// ARGV: incarnation, id of the finishing unit. A finished job is forgotten after a week.
inline constexpr const char* kFinished = R"lua(
redis.call('HSET', job, 'state', 'finished')
remove(ARGV[2], '*finish')
for i = 1, #KEYS do redis.call('EXPIRE', KEYS[i], 604800) end
return {'ok'}
)lua";

}  // namespace terrace::bake::scripts
