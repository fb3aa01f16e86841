// Objects of a bucket, written, listed and removed through GDAL's file systems (/vsis3/, /vsigs/, /vsioss/). Read them
// with InputFile. The source policy decides which names are allowed.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"

namespace terrace::archive {

// Whether a place is in one of GDAL's file systems that can be written.
bool IsBucket(const std::string& place);

// For programs that write to buckets, before the first request. Requests that fail temporarily are repeated up to three
// times. A request that cannot connect within 10 s, or transfers less than 1 byte per second for 10 s, fails. By
// default GDAL repeats none and waits without a limit.
void LimitRequests();

// Writes an object that is there as a whole or not at all: one request, or an upload in parts that is completed at the
// end. `descriptor`: a file, read from its beginning. kInvalidArgument: the policy does not allow the name.
// kUnavailable: the store refuses it, or does not answer; the message says why.
Result<void> PutFile(int descriptor, const std::string& object);
Result<void> PutText(std::string_view text, const std::string& object);

// The names directly below a folder. kUnavailable: there are none, or the folder cannot be listed; GDAL does not tell
// the two apart.
Result<std::vector<std::string>> NamesInBucket(const std::string& folder);

// Removes an object if it is there; all errors are ignored.
void RemoveObject(const std::string& object);

}  // namespace terrace::archive
