defmodule Lab.Fleet.Nodes.Command do
  @moduledoc false
  # Writes the commands by which a person reaches a fleet's nodes, as text. Pure.

  @doc """
  The lines that tell people how to reach a fleet's processes.

      iex> [first, _world, attach | _] =
      ...>   Lab.Fleet.Nodes.Command.lines([{:mag1, :"mag1@127.0.0.1", "71"}, {:world, :"world@127.0.0.1", "70"}], "/tmp/x")
      iex> first
      "mag1 pid 71 node mag1@127.0.0.1"
      iex> attach
      "attach:   HOME=/tmp/x iex --hidden --name me$$@127.0.0.1 --remsh mag1@127.0.0.1"
  """
  @spec lines([{atom(), node(), pid :: String.t() | nil}], Path.t()) :: [String.t()]
  def lines(nodes, home) do
    width =
      nodes |> Enum.map(fn {id, _, _} -> String.length("#{id}") end) |> Enum.max(fn -> 0 end)

    width = if length(nodes) > 2, do: width, else: 0
    living = Enum.filter(nodes, fn {_id, _node, pid} -> pid end)
    for({id, node, pid} <- nodes, do: line(id, node, pid, width)) ++ ways(living, home)
  end

  defp ways([], _home), do: ["no process is left to attach to"]

  defp ways([{_id, node, pid} | _], home) do
    [_name, host] = node |> Atom.to_string() |> String.split("@")

    [
      "attach:   HOME=#{home} iex --hidden --name me$$@#{host} --remsh #{node}",
      "kill:     kill -9 #{pid}     freeze: kill -STOP #{pid}     continue: kill -CONT #{pid}"
    ]
  end

  defp line(id, node, nil, width), do: "#{pad(id, width)} is gone, was node #{node}"
  defp line(id, node, pid, width), do: "#{pad(id, width)} pid #{pid} node #{node}"
  defp pad(id, width), do: String.pad_trailing("#{id}", width)
end
