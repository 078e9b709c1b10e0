defmodule Bridge do
  @moduledoc """
  Serves a live fleet to programs that other people have: `bin/demo --foxglove`, `bin/console --rosbridge`.

  | module | what it is |
  |---|---|
  | `Bridge.Catalogue`, `Bridge.Topics`, `Bridge.Ros`, `Bridge.Request` | pure: what a fleet says, and what it can be asked |
  | `Bridge.Broker`, `Bridge.Hub` | which messages which client gets, as a function; the process that asks the fleet |
  | `Bridge.Dialect`, `Bridge.Foxglove`, `Bridge.Rosbridge`, `Bridge.Rosapi` | pure: what a protocol is; Foxglove's, rosbridge's |
  | `Bridge.Frames`, `Bridge.Json`, `Bridge.Cbor`, `Bridge.Connection` | pure: frames of a WebSocket, JSON of strangers, CBOR; the process of a client |

  The web server is that of the page (`Console.Page.Service`), with its door, token and limits. No robot knows it: whatever
  becomes of it or its clients changes nothing for them. Orders take the way of a person's (`Console.Orders`), and the log says whose
  each was.
  """
end
