defmodule Swarm.MeshNodes.Absurd do
  @moduledoc """
  What a robot with a bug would sign and send: each of the mesh's messages with each of its fields
  replaced by each senseless term. Run on a test's node.
  """
  alias Swarm.Message
  alias Swarm.Agreement.Round
  alias Swarm.Membership.Heartbeat

  @doc """
  Sends each `every`-th of them to the others, slowly enough for their sockets, and returns how
  many it sent.
  """
  @spec send_all(robot :: atom(), pos_integer()) :: non_neg_integer()
  def send_all(me, every) do
    messages = messages(me) ++ for m <- messages(me), do: %{m | kind: :relay}
    relayed = for m <- messages, do: %Message{from: me, kind: :relay, body: Map.put(m, :hops, 1)}
    services = for service <- [:rows, :stop], term <- services(me), do: {service, term}

    messages = Enum.take_every(messages ++ relayed, every)
    services = Enum.take_every(services, every)

    for {message, n} <- Enum.with_index(messages) do
      Mesh.speak(:all, message)
      pause(n)
    end

    for {{service, term}, n} <- Enum.with_index(services) do
      Mesh.cast(service, term)
      pause(n)
    end

    length(messages) + length(services)
  end

  # A sender of more than 2,000 a second is not heard.
  defp pause(n) when rem(n, 100) != 0, do: :ok

  defp pause(_n) do
    receive do
      :never -> :ok
    after
      60 -> :ok
    end
  end

  defp messages(me) do
    for {kind, body} <- bodies(me), spoilt <- [:junk | spoilt(body)] do
      %Message{from: me, kind: kind, body: spoilt}
    end
  end

  defp bodies(me) do
    claim = %Robot.Mission.Claim{mission: Some.Mission, version: 1, fields: %{}}
    letter = %Round.Letter{id: {1, 1, me}, view: [me], remaining_ms: 900, purpose: :search}
    beat = %Heartbeat{boot: 1, sequence: 1, pose: {0, 0, 0}, twist: {0, 0}}
    [heartbeat: beat, round: letter, claim: claim]
  end

  defp spoilt(%module{} = body) do
    for {field, value} <- Map.from_struct(body), junk <- [{value, 1} | wild()] do
      Map.put(body, field, junk)
    end ++ [%{__struct__: module}, Map.put(body, :more, 1)]
  end

  defp services(me) do
    text = Atom.to_string(me)

    for(tag <- [:rows, :have, :want, :digest, :estop], a <- wild(), do: {tag, a}) ++
      for(tag <- [:rows, :have, :want], a <- wild(), do: {tag, [a]}) ++
      for(a <- wild(), b <- wild(), do: {:digest, a, b, [{text, 1}]}) ++
      for(a <- wild(), b <- wild(), do: {:have, a, b}) ++
      for(at <- 0..5, a <- wild(), do: {:rows, [put_elem({text, 1, 1, 1, 1, "x"}, at, a)]}) ++
      for(at <- 0..5, a <- wild(), do: {:rows, [put_elem(hint(text), at, a)]}) ++
      for(a <- wild(), b <- [{a, 1}, {text, a}], do: {:rows, [put_elem(hint(text), 3, b)]}) ++
      for(a <- wild(), do: {:rows, [{text, 1, 1, 1, 1, :erlang.term_to_binary({:about, a})}]}) ++
      for(a <- wild(), do: {:have, [{text, [{1, a, 1}, {1, 1, a}]}]}) ++
      for(a <- wild(), do: {:have, [{<<1>>, [{1, a, {text, 1}}, {1, 1, {a, a}}]}]}) ++
      for(at <- 0..2, a <- wild(), do: {:estop, put_elem({node(), 1, 1}, at, a), 0}) ++
      for(a <- wild(), do: {:estop, {node(), 1, 1}, a}) ++ wild()
  end

  defp hint(text), do: {<<1>>, 1, 1, {text, :erlang.phash2("x", 4_294_967_296)}, 1, "x"}

  defp wild do
    [
      nil,
      true,
      :junk,
      -1,
      0,
      1.0e308,
      -0.0,
      Bitwise.bsl(1, 63),
      Bitwise.bsl(1, 64) - 1,
      Bitwise.bsl(1, 80_000),
      "",
      <<255>>,
      <<1::3>>,
      :binary.copy("x", 40_000),
      [],
      [1 | 2],
      [nil],
      Enum.to_list(1..10_000),
      {},
      {1.0e308, 1.0e308, 1.0e308},
      %{},
      %{junk: 1},
      %{__struct__: :junk},
      self(),
      make_ref(),
      &is_atom/1,
      Enum.reduce(1..5_000, [], fn _n, term -> [term] end)
    ]
  end
end
