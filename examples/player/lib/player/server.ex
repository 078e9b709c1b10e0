defmodule Player.Server do
  @moduledoc """
  Serves each robot of a live fleet to programs that are written for the Player device server 3 (libplayerc): `bin/demo --player`,
  `bin/console --player`. The first robot is at port 6665, the next at 6666, and so on, in the order of their names; robots that come
  later follow.

  | module | what it is |
  |---|---|
  | `Player.Xdr`, `Player.Wire` | pure: the bytes of values, and of messages |
  | `Player.Queue`, `Player.Session` | pure: what a client gets when; what it says, and what comes of it |
  | `Player.Devices`, `Player.Readings`, `Player.Source` | a robot as Player's devices; what they measure; whom that is asked |
  | `Player.Door`, `Player.Connection` | the process that listens; that of a client |

  Data comes by `Bridge.Hub`, as for the protocols of `Bridge`, and orders take the way of a person's (`Console.Orders`). Clients know
  no token, so they are served on this machine alone.
  """
  @behaviour Console.Page.Service
  alias Bridge.Hub
  alias Player.{Door, Readings, Source}

  @impl Console.Page.Service
  def scheme, do: "player"

  @impl Console.Page.Service
  def feed(%{module: module, live: live} = source) do
    {Hub, Map.merge(source, %{module: Source, live: {module, live}, catalogue: Readings})}
  end

  @impl Console.Page.Service
  def door(options), do: {Door, options}
end
