defmodule Mesh.ForgedSequenceTest do
  # Somebody with the fleet's key invents the last sequence number of a node's session.
  use ExUnit.Case, async: true
  alias Mesh.Protocol.Packet.ReplayProtection

  @last 0xFFFFFFFFFFFFFFFF

  defp stamp(sequence, now_ms),
    do: %{sender: "b@lab", session: 9, sequence: sequence, time_ms: now_ms}

  # The real node speaks ten times a second; returns the times at which it was believed.
  defp heard(replay, sequences, from_ms) do
    Enum.reduce(Enum.with_index(sequences), {replay, []}, fn {sequence, n}, {replay, times} ->
      now_ms = from_ms + 100 * n

      with false <- ReplayProtection.copy?(replay, "b@lab", 9, sequence),
           {:ok, replay} <- ReplayProtection.admit(replay, stamp(sequence, now_ms), nil, now_ms) do
        {replay, times ++ [now_ms]}
      else
        {:error, _why, replay} -> {replay, times}
        true -> {replay, times}
      end
    end)
  end

  test "the session is shut out for two seconds, and nothing old gets in by that" do
    {:ok, replay} = ReplayProtection.admit(ReplayProtection.new(7), stamp(1, 0), {7, 0}, 0)
    {replay, times} = heard(replay, 2..30, 100)
    assert length(times) == 29

    for forged <- [@last, 5_000] do
      {:ok, replay} = ReplayProtection.admit(replay, stamp(forged, 3_000), nil, 3_000)
      {replay, times} = heard(replay, 31..80, 3_100)
      assert [first | _] = times
      assert first in 5_000..5_200
      assert times == Enum.to_list(first..8_000//100)

      # The forged one again, and what was heard before: stale, or heard.
      for {sequence, time_ms} <- [{forged, 3_000}, {30, 2_900}, {31, 3_100}, {80, 8_000}] do
        assert {:error, why, _guard} =
                 ReplayProtection.admit(replay, stamp(sequence, time_ms), nil, 8_010)

        assert why in [:stale, :doubled]
      end
    end
  end

  test "as long as a session is heard, the window stays: a jump of the numbers is no way round it" do
    {:ok, replay} = ReplayProtection.admit(ReplayProtection.new(7), stamp(1, 0), {7, 0}, 0)
    {replay, _times} = heard(replay, 2..30, 100)

    for time_ms <- [3_000, 3_900, 4_900],
        do:
          assert(
            {:error, :doubled, _} =
              ReplayProtection.admit(replay, stamp(7, time_ms), nil, time_ms)
          )
  end
end
